"""Table of what was fitted, from any source, in the columns of a run's measurements.csv."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from dataclasses import asdict

import numpy as np

from acquisition.results.measurements_csv import COLUMNS
from acquisition.results.sources import Source
from analysis.data.csv import columns
from analysis.data.measurements import Measurements
from instrument.geometry import FloatArray, IntArray


def fitted_table(source: Source) -> str:
    """Return the text of the table; `gonio fit` gives the same from it as from the source.

    What the source does not state is an empty cell. Relative values stand in the column radiance,
    times cos(theta_i), and are relative to a level of each lamp setting when they are read again.
    """
    m = source.measurements
    known = dict(_values(m)) | dict(_for_fits(m))
    if source.acceptance is not None:
        known |= {k: np.full(m.size, v) for k, v in asdict(source.acceptance).items()}
    header = list(dict.fromkeys((*COLUMNS, *known)))
    cells = [_cells(known[name]) if name in known else [""] * m.size for name in header]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(zip(*cells, strict=True))
    return text.getvalue()


def _values(m: Measurements) -> Iterator[tuple[str, FloatArray]]:
    """Angles (N,) in degrees, and values (N,) with u, in 1/sr or relative, by column."""
    yield "theta_i_deg", m.theta_i_deg
    yield "theta_r_deg", m.theta_r_deg
    yield "dphi_deg", m.dphi_deg
    shared = np.sum([np.square(error.u_relative) for error in m.shared], axis=0)
    u = None if m.u_random is None else np.hypot(m.u_random, m.brdf * np.sqrt(shared))
    name, scale = ("radiance", np.cos(m.geometry.theta_i)) if m.relative else ("brdf", 1.0)
    yield name, m.brdf * scale
    if u is not None:
        yield f"u_{name}", u * scale


def _for_fits(m: Measurements) -> Iterator[tuple[str, FloatArray | IntArray]]:
    """Columns (N,) that a fit reads beyond angles, values and u."""
    yield columns.LAMP_SETTING.name, m.lamp_setting + 1
    if m.u_random is not None and (m.shared or m.relative):
        yield columns.U_INDEPENDENT.name, m.u_random / np.abs(m.brdf)
    for stem, error in zip(columns.stems(e.name for e in m.shared), m.shared, strict=True):
        yield columns.u_shared(stem).name, error.u_relative
        yield columns.group(stem).name, error.group + 1
        for column, angle in zip(columns.angles_by(stem), error.angles_deg, strict=True):
            if np.any(angle):
                yield column.name, np.broadcast_to(np.asarray(angle), (m.size,))
    if np.any(m.blur_deg):
        yield columns.BLUR.name, np.broadcast_to(m.blur_deg, m.size)
    angles = (m.u_theta_i_deg, m.u_theta_r_deg, m.u_dphi_deg)
    for column, u in zip(columns.U_ANGLES, angles, strict=True):
        if u:
            yield column.name, np.full(m.size, u)


def _cells(values: FloatArray | IntArray) -> list[str]:
    return [repr(value) if np.isfinite(value) else "" for value in values.tolist()]
