"""ASTM E1392 text: a header of free lines, then rows of angles in radians and a BRDF in 1/sr.

::

    free lines
    NUM_POINTS n
    VARS theta_i,phi_i,theta_s,phi_s,550nm
    0.5235987755982988,0.0,0.2617993877991494,3.141592653589793,0.0917

Both directions point away from the sample, so that phi_s - phi_i is 0 on the lamp's side and pi on
the mirror side: the program's own dphi. phi_i is written as 0. The last column has the name of the
wavelength, or BRDF. The layout, and this meaning of the azimuths, are those that the reader of
libbsdf (BSDFProcessor, Kimura, 2014-2019) accepts; it looks for the words NUM_POINTS and VARS in
every header line, so that a fact which holds one of them stands in quotes. u has no column: a
second column of values would be taken for a second wavelength.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

import numpy as np

from analysis.data.csv.columns import BRDF
from analysis.exchange.exported import BrdfTable, Export
from analysis.exchange.tables.header import exact, stated, u_table
from analysis.exchange.tables.rows import (
    PHI_RAD,
    THETA_I_RAD,
    THETA_R_RAD,
    Row,
    fields,
    in_degrees,
    parsed,
    table,
)
from instrument.text.quoting import shown
from instrument.text.text_file import TextFile, input_error

_KEYWORD = re.compile(r"(?<!\S)(NUM_POINTS|VARS)(?!\S)")
_NANOMETRES = re.compile(r"[0-9]+(\.[0-9]+)?")
_ANGLES = ("theta_i", "phi_i", "theta_s", "phi_s")
_ROW = "rows theta_i,phi_i,theta_s,phi_s,BRDF after a line VARS"


def files(export: Export, stem: str) -> Iterator[tuple[str, bytes]]:
    """Yield STEM.astm, and STEM.astm.u.csv where u is known."""
    export.require_absolute("astm")
    angles = export.table.geometry
    header = [_KEYWORD.sub(r'"\1"', line) for line in stated(export)]
    columns = zip(angles.theta_i, angles.theta_r, np.radians(angles.dphi_deg), export.table.brdf,
                  strict=True)  # fmt: skip
    lines = [
        "ASTM E1392 BRDF data, angles in rad, BRDF in 1/sr, all values as measured",
        "phi_s - phi_i: 0 on the source's side, pi on the mirror side",
        *header,
        f"NUM_POINTS {export.table.size}",
        f"VARS {','.join(_ANGLES)},{_value_name(export)}",
        *(f"{exact(i)},0.0,{exact(r)},{exact(phi)},{exact(f)}" for i, r, phi, f in columns),
        "",
    ]
    yield f"{stem}.astm", "\n".join(lines).encode(errors="replace")
    yield from u_table(export, stem, "astm")


def _value_name(export: Export) -> str:
    wavelength = export.facts.get("wavelength_nm", "").strip()
    return f"{wavelength}nm" if _NANOMETRES.fullmatch(wavelength) else "BRDF"


def is_astm(file: TextFile) -> bool:
    """True for a text whose header names its columns in a line VARS."""
    return any(text.split()[:1] == ["VARS"] for text in file.lines)


def read(file: TextFile) -> BrdfTable:
    """Read a table with one value column; raises `InputError` for what is not allowed.

    phi_s - phi_i is taken as stated in the module's description, and the values as BRDF in 1/sr.
    """
    number = _header_end(file)
    order = _order(file, number)
    rows = [
        _row(file, line, text, order)
        for line, text in enumerate(file.lines, 1)
        if line > number and text.strip()
    ]
    _check_count(file, number, len(rows))
    return table(file, [row for row in rows if row is not None], _ROW)


def _header_end(file: TextFile) -> int:
    """Number of the line VARS."""
    for line, text in enumerate(file.lines, 1):
        if text.split()[:1] == ["VARS"]:
            return line
    file.note(1, 1, f"no line VARS; allowed: {_ROW}")
    raise input_error(file)


def _order(file: TextFile, line: int) -> list[int]:
    """Index of theta_i, phi_i, theta_s, phi_s and the value among the columns; [] for a mistake."""
    text = file.lines[line - 1]
    names = [name for _, name in fields(text.split("VARS", 1)[1])]
    values = [n for n, name in enumerate(names) if name not in _ANGLES]
    missing = [name for name in _ANGLES if names.count(name) != 1]
    allowed = f"each of {', '.join(_ANGLES)} once, and one column of values"
    if missing or len(values) != 1:
        found = f"no single {missing[0]}" if missing else f"{len(values)} columns of values"
        file.note(line, 1, f"VARS: {found}; allowed: {allowed}; keep the column to be read")
        return []
    return [*(names.index(name) for name in _ANGLES), values[0]]


def _row(file: TextFile, line: int, text: str, order: list[int]) -> Row | None:
    found = fields(text)
    if not order:
        return None
    if len(found) != len(order):
        file.note(line, 1, f"row: {len(found)} numbers; allowed: {len(order)}, as VARS has names")
        return None
    columns = (THETA_I_RAD, PHI_RAD, THETA_R_RAD, PHI_RAD, BRDF)
    theta_i, phi_i, theta_s, phi_s, brdf = (
        parsed(file, line, column, found[n]) for column, n in zip(columns, order, strict=True)
    )
    dphi = in_degrees(phi_s - phi_i)
    return in_degrees(theta_i), in_degrees(theta_s), dphi, brdf, math.nan


def _check_count(file: TextFile, number: int, rows: int) -> None:
    """Note a NUM_POINTS that differs from the number of rows."""
    for line, text in enumerate(file.lines[:number], 1):
        words = text.split()
        if words[:1] == ["NUM_POINTS"] and words[1:] != [str(rows)]:
            found = shown(" ".join(words[1:]))
            file.note(line, 1, f"NUM_POINTS: {found}; allowed: {rows}, the number of rows")
