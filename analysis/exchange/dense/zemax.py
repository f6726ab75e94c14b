"""Zemax tabular BSDF: a grid about the specular direction for each incidence, in degrees and 1/sr.

::

    # comments
    Source  Measured
    Symmetry  PlaneSymmetrical
    SpectralContent  Monochrome
    ScatterType  BRDF
    SampleRotation  1
    0
    AngleOfIncidence  2
    15.0  30.0
    ScatterAzimuth  2
    0.0  180.0
    ScatterRadial  3
    0.0  5.0  10.0

    Monochrome
    DataBegin
    TIS 0.31
    0.0917  0.0915  0.0911
    ...
    DataEnd

A block for each incidence begins with its TIS, the reflected fraction, integrated over the grid;
it has a row for each azimuth. Azimuth 0 points from the specular direction towards the normal,
and azimuths of 0 to 180 stand for both sides (PlaneSymmetrical). Source: "Zemax Tabular BSDF data
file format" (Rykowski; support.zemax.com), and "BSDF Data Interchange File Format Specification"
(2008); scans in the plane of incidence are given to OpticStudio as the azimuths 0 and 180 by
others too. OpticStudio allows file names of up to 60 characters.

Comments at the top say of each value if it is measured. The program's own reader takes those that
are, and all values of a file without such comments.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from analysis.exchange.dense.specular_grid import MARKS, SpecularGrid, specular_grid, total_scatter
from analysis.exchange.exported import Export
from analysis.exchange.tables.header import exact, stated, u_table

MARKS_KEY = "marks"


def files(export: Export, stem: str) -> Iterator[tuple[str, bytes]]:
    """Yield STEM.bsdf, and STEM.zemax.u.csv where u is known."""
    export.require_absolute("zemax")
    grid = specular_grid(export.table, "zemax")
    lines = [*(f"# {line}" for line in _comments(export, grid)), *_header(grid), *_data(grid), ""]
    yield f"{stem}.bsdf", "\n".join(lines).encode(errors="replace")
    yield from u_table(export, stem, "zemax")


def _comments(export: Export, grid: SpecularGrid) -> Iterator[str]:
    yield "BRDF in 1/sr, angles in degrees; TIS is integrated over the grid"
    yield from stated(export)
    counts = Counter(grid.marks.ravel().tolist())
    for mark, meaning in MARKS.items():
        yield f"{mark}: {meaning}, {counts[mark]} of {grid.marks.size} values"
    if grid.azimuth_deg.size == 2:
        yield "nothing was measured out of the plane of incidence: azimuths between 0 and 180 are"
        yield "interpolated by whoever reads this"
    for theta_i, block in zip(grid.theta_i_deg, grid.marks, strict=True):
        for azimuth, row in zip(grid.azimuth_deg, block, strict=True):
            yield f"{MARKS_KEY} {exact(theta_i)} {exact(azimuth)} {''.join(row)}"


def _header(grid: SpecularGrid) -> Iterator[str]:
    yield from ("Source  Measured", "Symmetry  PlaneSymmetrical", "SpectralContent  Monochrome")
    yield from ("ScatterType  BRDF", "SampleRotation  1", "0")
    axes = {
        "AngleOfIncidence": grid.theta_i_deg,
        "ScatterAzimuth": grid.azimuth_deg,
        "ScatterRadial": grid.radial_deg,
    }
    for name, axis in axes.items():
        yield from (f"{name}  {axis.size}", "\t".join(map(exact, axis)))
    yield ""


def _data(grid: SpecularGrid) -> Iterator[str]:
    yield from ("Monochrome", "DataBegin")
    for total, block in zip(total_scatter(grid), grid.brdf, strict=True):
        yield f"TIS {exact(np.round(total, 6))}"
        yield from ("\t".join(map(exact, row)) for row in block)
    yield "DataEnd"
