"""Vignetting beyond cos^4 over the cells, by the size and u that the rig file states.

The values of a run are corrected for the window's mean loss. A cell has the loss of its own place,
relative to that mean.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquisition.measure.rectify.cell_grid import CellGrid
from instrument.config.protocol import PatchConfig
from instrument.config.rig import Rig
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole

_PARTS = 9  # of the patch, along a side


class Vignetting:
    """Loss of light that grows with the square of the distance from the picture's middle."""

    def __init__(self, rig: Rig, patch: PatchConfig) -> None:
        self._pinhole, self._lines = Pinhole.of(rig), rig.uncertainty
        part = (np.arange(_PARTS) + 0.5) / _PARTS - 0.5
        self._patch = patch.width_mm * part, patch.height_mm * part

    def take_out(self, cells: NDArray[np.float32], grid: CellGrid, theta_r_deg: float) -> None:
        """Divide cells (rows, columns), in any unit, by their share of the window's light."""
        loss = self._lines.vignetting
        if loss:
            patch = 1 - loss * self._square(*self._patch, theta_r_deg).mean()
            cells *= (patch / (1 - loss * self._square(grid.x_mm, grid.y_mm, theta_r_deg))).astype(
                np.float32
            )

    def u_relative(self, grid: CellGrid) -> FloatArray:
        """Return the relative u (rows, columns) of the cells' light; dimensionless.

        As seen along the normal: alike at all angles but for perspective.
        """
        usual = self._square(*self._patch, 0.0).mean()
        away = np.abs(self._square(grid.x_mm, grid.y_mm, 0.0) - usual)
        return np.asarray(self._lines.u_vignetting * away)

    def _square(self, x_mm: FloatArray, y_mm: FloatArray, theta_r_deg: float) -> FloatArray:
        """Square of the distance of places (rows, columns) from the picture's middle."""
        places = np.stack(np.meshgrid(x_mm, y_mm), axis=-1)
        return self._pinhole.from_middle(self._pinhole.project(places, theta_r_deg)) ** 2
