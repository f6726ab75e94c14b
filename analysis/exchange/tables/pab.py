"""pab-opto text: one file per incidence, rows of theta, phi in degrees and a BSDF in 1/sr.

::

    #sample_name "plate 3"
    #format: theta phi BSDF
    #intheta 30.0
    #inphi 0.0
    #upphi 0.0
    15.0 180.0 0.0917

Both directions point away from the sample, so that phi - inphi is the program's own dphi: 0 on the
lamp's side, 180 on the mirror side; inphi is written as 0. Written for `pabopto2bsdf` of Radiance,
which needs two or more incidences with directions out of the plane of incidence to interpolate.
Its reader (LBNL, pabopto2bsdf.c) sets the limits: a line of at most 2047 bytes, a name without
quotes in 255 bytes; a line `#` with a space after it is a comment. u has no column.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from analysis.data.csv.columns import ANGLES, BRDF
from analysis.exchange.exported import BrdfTable, Export
from analysis.exchange.tables.header import exact, stated, u_table
from analysis.exchange.tables.rows import Row, parsed, table, words
from instrument.geometry import BoolArray
from instrument.text.csv_column import Column
from instrument.text.quoting import shown
from instrument.text.text_file import TextFile

_LONGEST_NAME, _LONGEST_LINE = 60, 400  # characters of up to 4 bytes
_KEY = re.compile(r"#(format: theta phi|intheta|inphi|upphi|incident_angle|colorimetry:)\s(.*)")
_INTHETA = ANGLES[0]
_OUT = Column("theta", "deg", "0 to 90 deg, on the side of the incidence", 0.0, 90.0)
_PHI = Column("phi", "deg", "-1e6 to 1e6 deg", -1e6, 1e6)
_ROW = "rows of theta phi BSDF"


def files(export: Export, stem: str) -> Iterator[tuple[str, bytes]]:
    """Yield STEM.pab, STEM_2.pab, ... by incidence as measured; STEM.pab.u.csv where u is known."""
    export.require_absolute("pab")
    theta_i = export.table.geometry.theta_i_deg
    for n, angle in enumerate(dict.fromkeys(theta_i.tolist()), 1):
        lines = [*_header(export, angle), *_rows(export.table, theta_i == angle), ""]
        name = f"{stem}.pab" if n == 1 else f"{stem}_{n}.pab"
        yield name, "\n".join(lines).encode(errors="replace")
    yield from u_table(export, stem, "pab")


def _header(export: Export, theta_i: float) -> list[str]:
    name = export.sample.replace('"', "'")
    facts = [
        f"# {line[start : start + _LONGEST_LINE]}"
        for line in stated(export)
        for start in range(0, len(line), _LONGEST_LINE)
    ]
    return [
        f'#sample_name "{name[:_LONGEST_NAME]}"',
        "#format: theta phi BSDF",
        f"#intheta {exact(theta_i)}",
        "#inphi 0.0",
        "#upphi 0.0",
        "# BSDF in 1/sr as measured, angles in degrees; phi 0: source's side, 180: mirror side",
        *facts,
    ]


def _rows(measured: BrdfTable, points: BoolArray) -> list[str]:
    angles = measured.geometry
    columns = (angles.theta_r_deg[points], angles.dphi_deg[points], measured.brdf[points])
    return [" ".join(map(exact, row)) for row in np.transpose(columns)]


@dataclass(slots=True)
class _Head:
    """Facts of a header: line of its last entry, incidence in degrees, kind of the values."""

    line: int = 1
    kind: str = ""
    values: int = 1
    angles: dict[str, float] = field(default_factory=dict)


def is_pab(file: TextFile) -> bool:
    """True for a text with a line `#format: theta phi`."""
    return any(text.startswith("#format: theta phi") for text in file.lines)


def read(file: TextFile) -> BrdfTable:
    """Read one incidence; raises `InputError` for what is not allowed.

    Values of a DSF are divided by cos(theta), as the header states that they hold it.
    """
    head = _read_head(file)
    rows = [_row(file, line, text, head) for line, text in file.rows()]
    return table(file, [row for row in rows if row is not None], _ROW)


def _read_head(file: TextFile) -> _Head:
    head = _Head()
    for line, text in enumerate(file.lines, 1):
        found = _KEY.match(text)
        if found is None:
            continue
        head.line, rest = line, [(n + found.start(2), word) for n, word in words(found[2])]
        if found[1] == "format: theta phi":
            head.kind = found[2].strip().upper()
        elif found[1] == "colorimetry:":
            head.values = 3 if found[2].strip().upper() == "CIE-XYZ" else 1
        else:
            _read_angles(file, line, found[1], rest, head)
    _check(file, head)
    return head


def _read_angles(
    file: TextFile, line: int, key: str, rest: list[tuple[int, str]], head: _Head
) -> None:
    """Enter the angles of one header line."""
    names = ("intheta", "inphi") if key == "incident_angle" else (key,)
    if len(rest) != len(names):
        file.note(line, 1, f"#{key}: {len(rest)} numbers; allowed: {len(names)}, in degrees")
        return
    for name, word in zip(names, rest, strict=True):
        head.angles[name] = parsed(file, line, _INTHETA if name == "intheta" else _PHI, word)


def _check(file: TextFile, head: _Head) -> None:
    if head.kind not in {"BSDF", "BRDF", "DSF"}:
        what = f"#format: theta phi {shown(head.kind)}; allowed: BSDF, BRDF or DSF (reflection)"
        file.note(head.line, 1, what)
    if head.values != 1:
        file.note(head.line, 1, "#colorimetry: CIE-XYZ; allowed: CIE-Y, one value in each row")
    for name in ("intheta", "inphi"):
        if name not in head.angles:
            file.note(head.line, 1, f"no #{name}; allowed: the incidence, #intheta and #inphi")
            head.angles[name] = math.nan


def _row(file: TextFile, line: int, text: str, head: _Head) -> Row | None:
    found = words(text)
    if len(found) != 3:
        file.note(line, 1, f"row: {len(found)} numbers; allowed: 3 (theta phi BSDF)")
        return None
    columns = (_OUT, _PHI, BRDF)
    theta, phi, value = (parsed(file, line, *pair) for pair in zip(columns, found, strict=True))
    if head.kind == "DSF":
        if theta >= 90:
            file.note(line, 1, f"theta: {theta:g} deg in a DSF; allowed: less than 90 deg")
            return None
        value /= math.cos(math.radians(theta))
    return head.angles["intheta"], theta, phi - head.angles["inphi"], value, math.nan
