"""Light of window and cells in a picture of the sample, wherever its plate lies."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.measure.plate.markers import known_place
from acquisition.measure.rectify.cell_grid import CellGrid
from acquisition.measure.rectify.light import FloatImage, window_dn
from acquisition.measure.rectify.rectified import rectify
from instrument.config.protocol import Protocol
from instrument.pinhole import Pinhole


def cells_of(
    light: FloatImage,
    image: NDArray[Any],
    theta_r_deg: float,
    grid: CellGrid,
    pinhole: Pinhole,
    protocol: Protocol,
    height_mm: float = 0.0,
) -> tuple[float, FloatImage]:
    """Return the light of the window and of the cells (rows, columns), in DN.

    light: (rows, columns) in DN, as `light_dn` returns it, of frames of which `image`, in counts,
    is the first. With markers in the protocol they tell where the plate lies, and its height with
    it; where fewer than two are seen, cells have no value.
    """
    if protocol.markers is None:
        window = window_dn(light, theta_r_deg, pinhole, protocol.window)
        return window, rectify(light, grid, pinhole, theta_r_deg, height_mm)
    place = known_place(image, theta_r_deg, pinhole, protocol.markers)
    if place is None:
        return math.nan, np.full((grid.rows, grid.columns), np.nan, dtype=np.float32)
    window = window_dn(light, theta_r_deg, pinhole, protocol.window, (place.x_mm, place.y_mm))
    return window, rectify(light, grid, pinhole, theta_r_deg, height_mm, place.to_table())
