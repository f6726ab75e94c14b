"""The table `measurements.csv`: one row for each measured geometry.

It states all that a fit needs, in the columns of `analysis.data.csv.columns`, and numbers with all
their digits: `gonio fit` gives the same from the table as from the run's folder.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from itertools import repeat

import numpy as np

from acquisition.results.reduction import Reduced, shared_errors
from analysis.data.acceptance import Acceptance
from analysis.data.csv import columns
from instrument.config.load import Loaded
from instrument.geometry import FloatArray, IntArray

COLUMNS = (
    *("theta_i_deg", "theta_r_deg", "dphi_deg", "radiance", "u_radiance", "brdf", "u_brdf"),
    *("window_pixels", "exposure_s", "frames", "flags", "time_utc"),
)
NO_BRDF = "no brdf"


def measurements_csv(
    reduced: Reduced,
    u_brdf: FloatArray,
    parts: Mapping[str, FloatArray],
    loaded: Loaded,
    reasons: Mapping[int, str] | None = None,
) -> str:
    """Return the text of the table; u_brdf (N,) in 1/sr, its parts by name (N,) and relative.

    After COLUMNS, which are documented, comes one column for each component of the uncertainty,
    then what a fit needs, then the protocol's metadata as far as given, and what a scan that
    chose its geometries measured each for (`reasons`, by step). A value that is not known is an
    empty cell.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    components = ((f"u_{n.replace(' ', '_')}_relative", _cells(u)) for n, u in parts.items())
    metadata = ((name, repeat(fact)) for name, fact in loaded.protocol.metadata.given().items())
    further = dict((*components, *_columns_for_fits(reduced, loaded), *metadata))
    if reasons:
        further["chosen_for"] = [reasons.get(p.step, "") for p in reduced.points]
    writer.writerow([*COLUMNS, *further])
    values = (reduced.radiance, reduced.u_radiance, reduced.brdf, u_brdf)
    cells = [_cells(value) for value in values]
    pairs = zip(reduced.flags, reduced.valid, strict=True)
    flags = [flag or ("" if valid else NO_BRDF) for flag, valid in pairs]
    columns_after = zip(*further.values(), strict=False)  # constants repeat without end
    for n, (p, after) in enumerate(zip(reduced.points, columns_after, strict=True)):
        writer.writerow(
            (
                *(p.theta_i_deg, p.theta_r_deg, p.dphi_deg, *(cell[n] for cell in cells)),
                *(f"{p.window_pixels:.2f}", p.exposure_s, p.frames, flags[n], p.time_utc, *after),
            )
        )
    return text.getvalue()


def _columns_for_fits(reduced: Reduced, loaded: Loaded) -> Iterator[tuple[str, Iterable[str]]]:
    """Name and cells of each column that a fit reads, beyond the angles and the BRDF."""
    settings = np.array([p.lamp_setting for p in reduced.points], dtype=np.int64)
    yield columns.LAMP_SETTING.name, _numbered(settings)
    yield columns.U_INDEPENDENT.name, _cells(reduced.u_independent())
    blur_deg = np.array([p.blur_deg for p in reduced.points])
    if np.any(blur_deg):
        yield columns.BLUR.name, _cells(blur_deg)
    errors = shared_errors(reduced, loaded.rig)
    for stem, error in zip(columns.stems(e.name for e in errors), errors, strict=True):
        yield columns.u_shared(stem).name, _cells(error.u_relative)
        yield columns.group(stem).name, _numbered(error.group)
        for column, angle in zip(columns.angles_by(stem), error.angles_deg, strict=True):
            if np.any(angle):
                yield column.name, _cells(np.asarray(angle))
    axes = loaded.rig.axes
    u_deg = (axes.theta_i.u_deg, axes.theta_r.u_deg, axes.dphi.u_deg)
    for column, u in zip(columns.U_ANGLES, u_deg, strict=True):
        yield column.name, repeat(repr(float(u)))
    for name, value in asdict(Acceptance.of(loaded.rig, loaded.protocol.window)).items():
        yield name, repeat(repr(float(value)))


def _numbered(group: IntArray) -> list[str]:
    """Numbers from 1, as messages give them."""
    return [str(number + 1) for number in group.tolist()]


def _cells(values: FloatArray) -> list[str]:
    return [repr(value) if np.isfinite(value) else "" for value in values.tolist()]
