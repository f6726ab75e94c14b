"""Grid of square cells on the sample, centred on the rotation axis."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from instrument.config.protocol import Sample
from instrument.config.rig import Rig
from instrument.errors import InputError
from instrument.geometry import FloatArray

_LEAST_SIDE = 2  # cells; fewer are no map


@dataclass(frozen=True, slots=True)
class CellGrid:
    """Rows and columns of square cells with sides of `cell_mm`; row 0 has the largest y.

    middle_mm: y of the grid's middle, other than 0 for a part of a grid.
    """

    cell_mm: float
    rows: int
    columns: int
    middle_mm: float = 0.0

    @classmethod
    def of(cls, sample: Sample, rig: Rig, cell_mm: float) -> CellGrid:
        """Return the whole cells that the sample holds.

        Raises `InputError` for cells smaller than a pixel seen along the normal, or larger than
        half of the sample.
        """
        pixel_mm = rig.camera.field_width_mm / rig.camera.width_px
        largest_mm = min(sample.width_mm, sample.height_mm) / _LEAST_SIDE
        if not pixel_mm <= cell_mm <= largest_mm:
            raise InputError(
                f"cell_mm: {cell_mm:g} mm; allowed: {math.ceil(pixel_mm * 1e4) / 1e4:g} (a pixel "
                f"seen along the normal) to {largest_mm:g} mm (half of the sample)"
            )
        # A side that is a whole number of cells keeps them all, whatever its digits.
        rows, columns = (int(side / cell_mm + 1e-9) for side in (sample.height_mm, sample.width_mm))
        return cls(cell_mm, rows, columns)

    @property
    def x_mm(self) -> FloatArray:
        """Middles of the columns, (columns,) in mm from the axis."""
        place = np.arange(self.columns) - (self.columns - 1) / 2
        return np.asarray(self.cell_mm * place, dtype=np.float64)

    @property
    def y_mm(self) -> FloatArray:
        """Middles of the rows, (rows,) in mm from the axis, falling."""
        place = (self.rows - 1) / 2 - np.arange(self.rows)
        return np.asarray(self.middle_mm + self.cell_mm * place, dtype=np.float64)

    def band(self, start: int, stop: int) -> CellGrid:
        """Return the rows from `start` up to `stop`, which is not one of them."""
        middle_mm = float(self.y_mm[start : min(stop, self.rows)].mean())
        return CellGrid(self.cell_mm, min(stop, self.rows) - start, self.columns, middle_mm)

    def to_mm(self, per_cell: tuple[int, int] = (1, 1)) -> FloatArray:
        """Return the matrix (3, 3) from (column, row, 1) of parts of cells to (x, y, 1) in mm.

        `per_cell`: parts of a cell along its columns and rows.
        """
        across, down = (self.cell_mm / n for n in per_cell)
        left = -self.columns * self.cell_mm / 2 + across / 2
        top = self.middle_mm + self.rows * self.cell_mm / 2 - down / 2
        return np.array([[across, 0, left], [0, -down, top], [0, 0, 1.0]])
