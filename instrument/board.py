"""Board of squares and markers (ChArUco), by which the geometry of a rig is calibrated.

Coordinates as on the sample: x to the right and y upwards as the board is printed, from its middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from instrument.errors import InputError
from instrument.geometry import FloatArray

DICTIONARY = "DICT_4X4_50"
"""Markers of OpenCV's module `aruco`: 4 x 4 bits, of which 50 are told apart best."""
MARKER_SHARE = 0.75
"""Side of a marker relative to its square."""
MARGIN_SHARE = 0.125
"""White margin around the squares, relative to a square."""
_MOST_MARKERS = 50


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """Board of `columns` x `rows` squares with sides of `square_mm`; every second has a marker."""

    columns: int = 6
    rows: int = 6
    square_mm: float = 8.0

    def __post_init__(self) -> None:
        """Refuse sizes of which no board can be made."""
        for option, count in (("--columns", self.columns), ("--rows", self.rows)):
            if not 3 <= count <= 33:
                raise InputError(f"{option} {count}; allowed: 3 to 33 squares")
        if self.columns * self.rows // 2 > _MOST_MARKERS:
            raise InputError(
                f"--columns {self.columns}, --rows {self.rows}: {self.columns * self.rows} "
                f"squares; allowed: {2 * _MOST_MARKERS}, as there are {_MOST_MARKERS} markers"
            )
        if not 0.5 <= self.square_mm <= 200:
            raise InputError(f"--square-mm {self.square_mm:g}; allowed: 0.5 to 200 mm")

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height with the margin."""
        margin = 2 * MARGIN_SHARE
        return (self.columns + margin) * self.square_mm, (self.rows + margin) * self.square_mm

    def corners_mm(self) -> FloatArray:
        """Return the inner corners (n, 2) in mm, by their numbers: row by row from the top left."""
        columns, rows = np.arange(1, self.columns), np.arange(1, self.rows)
        x = self.square_mm * (columns - self.columns / 2)
        y = self.square_mm * (self.rows / 2 - rows)
        grid: FloatArray = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        return grid

    def __str__(self) -> str:
        return f"{self.columns} x {self.rows} squares of {self.square_mm:g} mm"
