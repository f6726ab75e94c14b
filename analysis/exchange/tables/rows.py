"""Rows of numbers in a text file of another program, read with their mistakes by position."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from analysis.exchange.exported import BrdfTable
from instrument.geometry import Geometry
from instrument.text.csv_column import Column
from instrument.text.text_file import TextFile, input_error

# 1e-6 rad: last digit that others print; 90 degrees may stand as 1.570797 rad.
_HALF_PI = math.pi / 2 + 1e-6
THETA_I_RAD = Column("theta_i", "rad", "0 to 1.570796 rad", 0.0, _HALF_PI)
THETA_R_RAD = Column("theta_r", "rad", "-1.570796 to 1.570796 rad", -_HALF_PI, _HALF_PI)
PHI_RAD = Column("phi", "rad", "-1e6 to 1e6 rad", -1e6, 1e6)

Row = tuple[float, float, float, float, float]


def words(text: str) -> list[tuple[int, str]]:
    """Column, from 1, and text of each word of a line."""
    return [(word.start() + 1, word[0]) for word in re.finditer(r"\S+", text)]


def fields(text: str) -> list[tuple[int, str]]:
    """Column, from 1, and text of each field of a line with commas."""
    found, column = [], 1
    for field in text.split(","):
        found.append((column, field.strip()))
        column += len(field) + 1
    return found


def parsed(file: TextFile, line: int, column: Column, field: tuple[int, str]) -> float:
    """Number in a field; NaN, with a mistake noted, where it is not allowed."""
    try:
        return column.parse(field[1])
    except ValueError as error:
        file.note(line, field[0], f"{column.name}: {error}")
        return math.nan


def in_degrees(angle_rad: float) -> float:
    """Angle in degrees; 30 degrees stay 30 after a way through radians."""
    return round(math.degrees(angle_rad), 9)


def table(file: TextFile, rows: Sequence[Row], what: str) -> BrdfTable:
    """Table of rows (theta_i, theta_r, dphi in degrees, BRDF and its u in 1/sr, NaN: not known).

    theta_r < 0 means dphi + 180. Raises `InputError` with the mistakes found in the file, or if
    there is no row; `what`: the rows that the format needs.
    """
    if not rows and not file.mistakes:
        file.note(len(file.lines), 1, f"no row of values; allowed: {what}")
    if file.mistakes:
        raise input_error(file)
    theta_i, theta_r, dphi, brdf, u_brdf = np.array(rows, dtype=np.float64).T
    geometry = Geometry.from_degrees(
        theta_i=np.minimum(theta_i, 90.0), theta_r=np.clip(theta_r, -90.0, 90.0), dphi=dphi
    )
    return BrdfTable(geometry=geometry, brdf=brdf.copy(), u_brdf=u_brdf.copy())
