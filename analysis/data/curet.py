"""Reader for the CUReT database: measured BRDFs of 61 real materials in the same 205 directions.

A folder has two text files, as published by Columbia and Utrecht universities:

- `table.txt`: a row `n theta_v phi_v theta_i phi_i` for each direction, in radians, n = 1, 2, ...;
  v is the camera's direction, i the lamp's, so that dphi = phi_v - phi_i.
- `abrdf.dat`: a row `sample v1 v2 ...` for each material: its BRDF in 1/sr in each direction.

No uncertainties are published. Some values are negative or zero: artefacts of the measurement,
which are masked and counted.

Source: K. J. Dana, B. van Ginneken, S. K. Nayar, J. J. Koenderink, "Reflectance and Texture of
Real-World Surfaces", ACM Transactions on Graphics 18 (1999).
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analysis.data.csv.columns import BRDF
from analysis.data.measurements import Measurements
from instrument.errors import InputError
from instrument.geometry import FloatArray
from instrument.text.quoting import printable, shown
from instrument.text.text_file import TextFile, input_error, parse_number, read_text

TABLE, VALUES = "table.txt", "abrdf.dat"

_ANGLES = ("theta_v", "phi_v", "theta_i", "phi_i")
# Last printed digit of an angle: 90 degrees may be printed as 1.570797 rad.
_ROUNDING_RAD = 1e-6
_ROW = "a row `sample v1 v2 ...` for each material"
_WHOLE = re.compile(r"[0-9]{1,9}")


@dataclass(frozen=True, slots=True)
class Curet:
    """One material of the database, and the numbers of directions left out.

    measurements: the positive values in the requested directions; no uncertainty is stated.
    negative, zero: numbers of negative and of zero values in the requested directions, masked.
    beyond: number of directions with an angle above the requested limit.
    directions: number of directions in the table, the sum of all these.
    """

    measurements: Measurements
    negative: int
    zero: int
    beyond: int
    directions: int


def read_curet(folder: Path, sample: int, max_theta_deg: float = 90.0) -> Curet:
    """Read one material, in the directions with both angles at most `max_theta_deg` degrees.

    Angles are compared to within 1e-6 rad, the last printed digit of the table.
    Raises `InputError` with every mistake in the direction table, the sample numbers and the
    sample's values; for a `max_theta_deg` that is not more than 0 and at most 90; and if no
    positive value is left.
    """
    if not 0 < max_theta_deg <= 90:
        what = f"max_theta_deg: {max_theta_deg:g} deg"
        raise InputError(f"{what}; allowed: more than 0 deg and at most 90 deg")
    table, values = _files(folder)
    directions_rad = _directions(table)
    brdf = _values(values, sample, len(directions_rad))
    if table.mistakes or values.mistakes:
        raise input_error(table, values)
    curet = _curet(np.array(directions_rad), np.array(brdf), max_theta_deg)
    if curet.measurements.size == 0:
        what = f"sample {sample} has no positive value with both angles at most {max_theta_deg:g}"
        raise InputError(f"{values.name}: {what} deg; allow larger angles (max_theta_deg)")
    return curet


def _files(folder: Path) -> tuple[TextFile, TextFile]:
    allowed = f"allowed: a folder with {TABLE} and {VALUES}"
    try:
        there = {path.name for path in folder.iterdir()}
        missing = [name for name in (TABLE, VALUES) if name not in there]
        problem = f"has no {' and no '.join(missing)}" if missing else ""
    except FileNotFoundError:
        problem = "no such folder"
    except NotADirectoryError:
        problem = "is not a folder"
    except (OSError, ValueError) as error:
        problem = f"cannot be read: {getattr(error, 'strerror', None) or error}"
    if problem:
        raise InputError(f"{printable(str(folder))}: {problem}; {allowed}")
    return read_text(folder / TABLE), read_text(folder / VALUES)


def _curet(directions_rad: FloatArray, brdf: FloatArray, max_theta_deg: float) -> Curet:
    """Mask values not requested or not positive; directions (N, 4) as in the table."""
    theta_v, phi_v, theta_i, phi_i = np.degrees(directions_rad).T
    rounding_deg = math.degrees(_ROUNDING_RAD)
    asked = np.maximum(theta_v, theta_i) <= max_theta_deg + rounding_deg
    used = asked & (brdf > 0)
    # Only rounding puts an angle above 90 degrees: _angle refuses every other one.
    theta_v, theta_i = np.minimum(theta_v, 90.0), np.minimum(theta_i, 90.0)
    return Curet(
        Measurements.bare(theta_i[used], theta_v[used], (phi_v - phi_i)[used], brdf[used]),
        negative=int(np.sum(asked & (brdf < 0))),
        zero=int(np.sum(asked & (brdf == 0))),
        beyond=int(np.sum(~asked)),
        directions=len(brdf),
    )


def _directions(file: TextFile) -> list[list[float]]:
    """Angles `theta_v, phi_v, theta_i, phi_i` of each row in radians; mistakes are noted."""
    directions: list[list[float]] = []
    for n, (line, text) in enumerate(file.rows(), start=1):
        fields = _fields(text)
        if len(fields) != 1 + len(_ANGLES):
            what = f"row: {_count(fields)}; allowed: {1 + len(_ANGLES)} (n {' '.join(_ANGLES)})"
            file.note(line, _place(text, fields, 1 + len(_ANGLES)), what)
        column, first = fields[0]
        if first != str(n):
            what = f"n: {shown(first)}; allowed: {n}, as the rows count from 1"
            file.note(line, column, what)
        angles = zip(_ANGLES, fields[1:], strict=False)
        directions.append([_angle(file, line, *angle) for angle in angles])
    if not directions:
        what = f"the file is empty; allowed: a row `n {' '.join(_ANGLES)}` for each direction"
        file.note(1, 1, what)
    return directions


def _angle(file: TextFile, line: int, name: str, field: tuple[int, str]) -> float:
    """An angle in radians; NaN, with a mistake noted, for text that is not a number."""
    column, text = field
    theta = name.startswith("theta")
    allowed = "a number from 0 to 1.570796 rad" if theta else "a number from -1e6 to 1e6 rad"
    try:
        angle = parse_number(text)
    except ValueError as error:
        file.note(line, column, f"{name}: {error}; allowed: {allowed}")
        return math.nan
    low, high = (0.0, math.pi / 2 + _ROUNDING_RAD) if theta else (-1e6, 1e6)
    if not low <= angle <= high:
        file.note(line, column, f"{name}: {text[:40]} rad; allowed: {allowed}")
    return angle


def _values(file: TextFile, sample: int, directions: int) -> list[float]:
    """Values of a sample in 1/sr; mistakes in them, and in all sample numbers, are noted."""
    lines: dict[int, int] = {}
    for line, text in file.rows():
        column, first = _fields(text)[0]
        if not _WHOLE.fullmatch(first):
            what = f"sample: {shown(first)} is not a whole number; allowed: the sample's number"
            file.note(line, column, what)
        elif lines.setdefault(int(first), line) != line:
            what = f"sample: {first} is already in line {lines[int(first)]}"
            file.note(line, column, f"{what}; allowed: each sample once")
    if sample in lines:
        return _row(file, lines[sample], directions)
    what = f"sample: {sample} is not in this file; allowed: {_ranges(lines)}"
    file.note(1, 1, what if lines else f"no sample; allowed: {_ROW}")
    return []


def _row(file: TextFile, line: int, directions: int) -> list[float]:
    """Values of one sample's row; mistakes are noted."""
    text = file.lines[line - 1]
    fields = _fields(text)
    if directions and len(fields) != 1 + directions:
        what = f"row: {_count(fields[1:])}; allowed: {directions}, one for each row of {TABLE}"
        file.note(line, _place(text, fields, 1 + directions), what)
    values = []
    for n, (column, value) in enumerate(fields[1:], start=1):
        try:
            values.append(BRDF.parse(value))
        except ValueError as error:
            file.note(line, column, f"v{n}: {error}")
    return values


def _fields(text: str) -> list[tuple[int, str]]:
    """Column, from 1, and text of each word of a line."""
    return [(word.start() + 1, word[0]) for word in re.finditer(r"\S+", text)]


def _count(fields: list[tuple[int, str]]) -> str:
    return f"{len(fields)} {'value' if len(fields) == 1 else 'values'}"


def _place(text: str, fields: list[tuple[int, str]], allowed: int) -> int:
    """Column of the end of a short row, or of the first field too many."""
    return fields[allowed][0] if len(fields) > allowed else len(text.rstrip()) + 1


def _ranges(numbers: Collection[int]) -> str:
    """Whole numbers in order, as `1-3, 7`."""
    known = set(numbers)
    starts = sorted(n for n in known if n - 1 not in known)
    ends = sorted(n for n in known if n + 1 not in known)
    pairs = zip(starts, ends, strict=True)
    return ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in pairs)
