"""Shadows that a surface casts on itself."""

from __future__ import annotations

import math

import numpy as np

from analysis.rendering.light import Light
from analysis.rendering.surface import Surface
from instrument.geometry import BoolArray, FloatArray

_NOTHING = -1e6  # height beside the object


def lit(surface: Surface, light: Light) -> BoolArray:
    """Return the mask (R, C) of the pixels that face the lamp and see it.

    From each pixel a ray goes to the lamp, in steps of a pixel along the rows or the columns,
    whichever it crosses faster; between two pixels the height is linear. What the viewer does not
    see behind the surface counts as solid.
    """
    facing = np.asarray(surface.seen & (surface.normal @ light.direction > 0))
    across = float(np.max(np.abs(light.direction[:2])))
    if surface.convex or across < 1e-12:
        return facing
    height = np.where(surface.seen, surface.height, _NOTHING)
    rise = float(light.direction[2]) * surface.pixel / across
    right, down = light.direction[0] / across, -light.direction[1] / across
    clear, top = facing.copy(), float(np.max(height))
    reach = top - float(np.min(surface.height[facing], initial=top))
    for step in range(1, max(height.shape)):
        if step * rise > reach or not clear.any():
            break
        clear &= _moved(height, step * down, step * right) - step * rise <= height
    return clear


def _moved(height: FloatArray, rows: float, columns: float) -> FloatArray:
    """Height (R, C) at the place that lies so many rows and columns farther on.

    One of the two is a whole number; along the other the height is linear between pixels.
    """
    low_row, low_column = math.floor(rows), math.floor(columns)
    down, right = rows - low_row, columns - low_column
    found = _shifted(height, low_row, low_column)
    if down or right:
        other = _shifted(height, low_row + (down > 0), low_column + (right > 0))
        found += (down + right) * (other - found)
    return found


def _shifted(height: FloatArray, rows: int, columns: int) -> FloatArray:
    """Height (R, C) moved by whole pixels; beside the picture is nothing."""
    found = np.full_like(height, _NOTHING)
    (into_rows, from_rows), (into_columns, from_columns) = (
        (slice(max(-shift, 0), size - max(shift, 0)), slice(max(shift, 0), size - max(-shift, 0)))
        for shift, size in zip((rows, columns), height.shape, strict=True)
    )
    if abs(rows) < height.shape[0] and abs(columns) < height.shape[1]:
        found[into_rows, into_columns] = height[from_rows, from_columns]
    return found
