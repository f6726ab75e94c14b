"""A picture rectified to the sample's plane: the mean light of each cell, by the one pinhole.

Each cell is sampled at points no farther apart than a pixel, between whose neighbours light is
interpolated; the mean of its points is the cell's light. Near grazing a cell is a narrow strip of
the picture: it then shares its pixels with its neighbours, and counts by the share of it that the
camera resolves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from acquisition.measure.rectify.cell_grid import CellGrid
from acquisition.measure.rectify.light import FloatImage
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole, apply_homography

LEAST_SHARE = 0.2  # resolved, below which a cell holds more of its neighbours than of itself


@dataclass(frozen=True, slots=True)
class Sampling:
    """Sampling of the cells at one view angle.

    per_cell: points along the columns and the rows of a cell. share: 0 to 1, of a cell that the
    camera resolves. noise: variance of a cell's light over that of a pixel.
    """

    per_cell: tuple[int, int]
    share: float
    noise: float


def rectify(
    light: FloatImage,
    grid: CellGrid,
    pinhole: Pinhole,
    theta_r_deg: float,
    height_mm: float = 0.0,
    to_table: FloatArray | None = None,
) -> FloatImage:
    """Return the light of each cell, (rows, columns) of the grid, in the unit of the pixels' light.

    height_mm: of the surface above the rotation axis. to_table: (3, 3), from points (x, y, 1) of
    the sample, in mm, to those of the table, where it lies in the middle if None. NaN for a cell
    that lies partly outside the picture, or has a pixel without a value.
    """
    import cv2

    sampled = sampling(grid, pinhole, theta_r_deg)
    across, down = sampled.per_cell
    size = grid.columns * across, grid.rows * down
    to_mm = grid.to_mm(sampled.per_cell)
    to_mm = to_mm if to_table is None else to_table @ to_mm
    to_pixels = pinhole.homography(theta_r_deg, height_mm) @ to_mm
    outside: dict[str, Any] = {"borderMode": cv2.BORDER_CONSTANT, "borderValue": math.nan}
    if pinhole.distortion:
        at = _bent_places(pinhole, to_pixels, size)
        points = cv2.remap(light, at[..., 0], at[..., 1], cv2.INTER_LINEAR, **outside)
    else:
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        points = cv2.warpPerspective(light, to_pixels, size, flags=flags, **outside)
    if sampled.per_cell != (1, 1):
        points = cv2.resize(points, (grid.columns, grid.rows), interpolation=cv2.INTER_AREA)
    return np.asarray(points, dtype=np.float32)


def _bent_places(pinhole: Pinhole, to_pixels: FloatArray, size: tuple[int, int]) -> FloatImage:
    """Return the pixels (rows, columns, 2) of points in a grid of a size, columns first."""
    columns, rows = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    points = apply_homography(to_pixels, np.stack([columns, rows], axis=-1))
    return pinhole.bent(points).astype(np.float32)


@lru_cache(maxsize=512)
def sampling(grid: CellGrid, pinhole: Pinhole, theta_r_deg: float) -> Sampling:
    """Return the sampling at a signed view angle, by the size of a cell on the axis in pixels."""
    half = grid.cell_mm / 2
    ends = np.array([[-half, 0.0], [half, 0.0], [0.0, -half], [0.0, half]])
    seen = apply_homography(pinhole.homography(theta_r_deg), ends)
    sides = seen[[1, 3]] - seen[[0, 2]]
    across_px, down_px = np.linalg.norm(sides, axis=1).tolist()
    per_cell = max(1, math.ceil(across_px)), max(1, math.ceil(down_px))
    share = min(1.0, across_px) * min(1.0, down_px)
    noise = _noise(across_px, per_cell[0]) * _noise(down_px, per_cell[1])
    return Sampling(per_cell, share, noise)


def _noise(side_px: float, points: int) -> float:
    """Variance of the mean of points over a side, of interpolated pixels, over that of one pixel.

    Two points share pixels by the product of their interpolations, which is a cubic B-spline of
    their distance, averaged over the places of the points between pixels.
    """
    at = np.arange(points) * (side_px / points)
    return float(np.mean(_cubic_spline(np.abs(np.subtract.outer(at, at)))))


def _cubic_spline(distance: FloatArray) -> FloatArray:
    near = 2 / 3 - distance**2 + distance**3 / 2
    far = np.maximum(2 - distance, 0.0) ** 3 / 6
    return np.where(distance < 1, near, far)


def off_edge(
    grid: CellGrid, edge_mm: tuple[float, float], blur_mm: tuple[float, float]
) -> FloatArray:
    """Return (rows, columns) 1 for cells that are at least a blur within the edge, 0 for others.

    Dimensionless. edge_mm: width and height of the sample; blur_mm: along x and along y.
    """
    x = edge_mm[0] / 2 - np.abs(grid.x_mm) - grid.cell_mm / 2 >= blur_mm[0] - 1e-9
    y = edge_mm[1] / 2 - np.abs(grid.y_mm) - grid.cell_mm / 2 >= blur_mm[1] - 1e-9
    return np.outer(y, x).astype(np.float64)
