"""ALTA text: rows of view angle, light angle and azimuth in radians, BRDF in 1/sr and its u.

::

    #ALTA HEADER BEGIN
    #DIM 3 1
    #PARAM_IN ISOTROPIC_TV_TL_DPHI
    #PARAM_OUT INV_STERADIAN
    #VS 1
    #ALTA HEADER END
    0.2617993877991494 0.5235987755982988 3.141592653589793 0.0917 0.0004

Both directions point away from the surface; the azimuth is that of the light less that of the view
(ALTA's own sources put the view at azimuth 0): the negative of the program's dphi, 0 on the lamp's
side, pi on the mirror side. `#VS 1` announces a radius of each value, here its standard
uncertainty, k = 1 (ALTA, "Data File Formats"; Inria 2013-2017); it is left out where a u is not
known.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from analysis.data.csv.columns import BRDF
from analysis.exchange.exported import BrdfTable, Export
from analysis.exchange.tables.header import exact, stated
from analysis.exchange.tables.rows import (
    PHI_RAD,
    THETA_R_RAD,
    Row,
    in_degrees,
    parsed,
    table,
    words,
)
from instrument.text.csv_column import Column
from instrument.text.quoting import shown
from instrument.text.text_file import TextFile

_ISOTROPIC, _SPHERICAL = "ISOTROPIC_TV_TL_DPHI", "SPHERICAL_TL_PL_TV_PV"
_DIMENSIONS = {_ISOTROPIC: 3, _SPHERICAL: 4}
_RADIUS = Column("radius (#VS)", "1/sr", "0 to 1e15 1/sr", 0.0, 1e15)
_ROW = "rows of angles in radians and a BRDF"


def files(export: Export, stem: str) -> Iterator[tuple[str, bytes]]:
    """Yield STEM.alta."""
    export.require_absolute("alta")
    angles, u_brdf = export.table.geometry, export.table.u_brdf
    known = bool(np.all(np.isfinite(u_brdf)))
    azimuth = np.radians(np.mod(-angles.dphi_deg, 360.0))
    columns = [angles.theta_r, angles.theta_i, azimuth, export.table.brdf]
    about_u = (
        "radius (#VS): standard uncertainty, k = 1" if known else "u is not known of all values"
    )
    comments = ["BRDF in 1/sr as measured, angles in rad", about_u, *stated(export)]
    lines = [
        "#ALTA HEADER BEGIN",
        "#DIM 3 1",
        f"#PARAM_IN {_ISOTROPIC}",
        "#PARAM_OUT INV_STERADIAN",
        *(["#VS 1"] if known else []),
        *(f"# {comment}" for comment in comments),
        "#ALTA HEADER END",
        *(" ".join(map(exact, row)) for row in np.transpose([*columns, u_brdf][: 4 + known])),
        "",
    ]
    yield f"{stem}.alta", "\n".join(lines).encode(errors="replace")


@dataclass(slots=True)
class _Head:
    """Facts of a header: number of angles and values, their meaning, and kind of the radius."""

    angles: int = 0
    values: int = 0
    inputs: str = ""
    outputs: str = ""
    segment: str = "0"


def is_alta(file: TextFile) -> bool:
    """True for a text whose header has a line #DIM."""
    return any(text.startswith("#DIM") for text in file.lines)


def read(file: TextFile) -> BrdfTable:
    """Read a table with one value a row; raises `InputError` for what is not allowed.

    A radius (#VS 1), or half the way from lower to upper bound (#VS 2), is taken as u; 0 as not
    known.
    """
    head = _read_head(file)
    rows = [_row(file, line, text, head) for line, text in file.rows()]
    return table(file, [row for row in rows if row is not None], _ROW)


def _read_head(file: TextFile) -> _Head:
    head, line = _Head(), 1
    for n, text in enumerate(file.lines, 1):
        key, *rest = text[1:].split() if text.startswith("#") else [""]
        if key == "DIM" and len(rest) == 2 and all(r.isdecimal() and len(r) < 4 for r in rest):
            line, head.angles, head.values = n, int(rest[0]), int(rest[1])
        elif key == "PARAM_IN":
            head.inputs = "".join(rest[:1])
        elif key == "PARAM_OUT":
            head.outputs = "".join(rest[:1])
        elif key == "VS":
            head.segment = "".join(rest[:1])
    _check(file, line, head)
    return head


def _check(file: TextFile, line: int, head: _Head) -> None:
    allowed = " or ".join(_DIMENSIONS)
    if head.inputs not in _DIMENSIONS:
        file.note(line, 1, f"#PARAM_IN {shown(head.inputs)}; allowed: {allowed}")
    elif (head.angles, head.values) != (_DIMENSIONS[head.inputs], 1):
        found = f"#DIM {head.angles} {head.values}"
        file.note(line, 1, f"{found}; allowed: {_DIMENSIONS[head.inputs]} 1 for {head.inputs}")
    if head.outputs != "INV_STERADIAN":
        file.note(
            line, 1, f"#PARAM_OUT {shown(head.outputs)}; allowed: INV_STERADIAN, without cosine"
        )
    if head.segment not in {"0", "1", "2"}:
        file.note(line, 1, f"#VS {shown(head.segment)}; allowed: 0, 1 or 2")


def _row(file: TextFile, line: int, text: str, head: _Head) -> Row | None:
    angles = _DIMENSIONS.get(head.inputs, 0)
    if not angles or head.segment not in {"0", "1", "2"}:
        return None
    bounds = {"0": [], "1": [_RADIUS], "2": [BRDF, BRDF]}[head.segment]
    kinds = {3: [THETA_R_RAD, THETA_R_RAD, PHI_RAD], 4: [THETA_R_RAD, PHI_RAD] * 2}[angles]
    columns, found = [*kinds, BRDF, *bounds], words(text)
    if len(found) != len(columns):
        file.note(
            line, 1, f"row: {len(found)} numbers; allowed: {len(columns)}, as the header says"
        )
        return None
    numbers = [parsed(file, line, *pair) for pair in zip(columns, found, strict=True)]
    view, light, azimuth = _angles(numbers[:angles])
    radius = _radius(numbers[angles + 1 :])
    return light, view, azimuth, numbers[angles], radius if radius > 0 else math.nan


def _angles(found: list[float]) -> tuple[float, float, float]:
    """Angle of view, of light (not negative), and their dphi, in degrees, from radians."""
    if len(found) == 3:
        view, light, dphi = found[0], found[1], -found[2]
    else:
        light, view, dphi = found[0], found[2], found[3] - found[1]
    turned = in_degrees(dphi) + (180 if light < 0 else 0)
    return in_degrees(view), in_degrees(abs(light)), turned


def _radius(bounds: list[float]) -> float:
    if len(bounds) == 2:
        return (bounds[1] - bounds[0]) / 2
    return bounds[0] if bounds else math.nan
