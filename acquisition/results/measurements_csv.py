"""The table `measurements.csv`: one row for each measured geometry."""

from __future__ import annotations

import csv
import io

import numpy as np

from acquisition.results.reduction import Reduced
from instrument.geometry import FloatArray

COLUMNS = (
    *("theta_i_deg", "theta_r_deg", "dphi_deg", "radiance", "u_radiance", "brdf", "u_brdf"),
    *("window_pixels", "exposure_s", "frames", "flags", "time_utc"),
)


def measurements_csv(reduced: Reduced, u_brdf: FloatArray) -> str:
    """Return the text of the table; u_brdf (N,) in 1/sr.

    After COLUMNS, which are documented, comes one column for each component of the uncertainty.
    A value that is not known is an empty cell.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    components = [f"u_{name.replace(' ', '_')}_relative" for name in reduced.parts]
    writer.writerow([*COLUMNS, *components])
    parts = list(reduced.parts.values())
    u_radiance = reduced.u_radiance
    for n, p in enumerate(reduced.points):
        values = (reduced.radiance[n], u_radiance[n], reduced.brdf[n], u_brdf[n])
        writer.writerow(
            [p.theta_i_deg, p.theta_r_deg, p.dphi_deg, *map(_cell, values)]
            + [f"{p.window_pixels:.2f}", p.exposure_s, p.frames, reduced.flags[n], p.time_utc]
            + [_cell(float(u[n])) for u in parts]
        )
    return text.getvalue()


def _cell(value: float) -> str:
    return f"{value:.9g}" if np.isfinite(value) else ""
