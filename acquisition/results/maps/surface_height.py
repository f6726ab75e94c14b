"""Height of the sample's surface above the rotation axis, found from its texture.

A surface at a height h is seen h tan(theta_r) beside its place. A fifth of a millimetre moves the
cells by one millimetre at 80 degrees: their curves would mix. The sample's own texture shows the
shift. Where the sample has none, a shift changes nothing either.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.measure.rectify.cell_grid import CellGrid
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole

_ROUNDS, _STEP_MM = 5, 0.005  # a smaller change ends the search
_NEAR_DEG = 35.0  # views up to here show the texture at its place
_MOST_CELLS = 160  # along a side, of the middle of the map
_LARGEST_U, _MOST_U = 0.05, 8.0  # of the placement: u of a height, and a height
_LEAST_CELLS, _SINGULAR = 100, 1e10


@dataclass(frozen=True, slots=True)
class Height:
    """Height in mm with its standard uncertainty; 0 with u = inf where no texture shows it."""

    mm: float
    u_mm: float


def middle(size: int) -> slice:
    """Return the part of a side, in cells, that the search uses."""
    start = max((size - _MOST_CELLS) // 2, 0)
    return slice(start, start + _MOST_CELLS)


def find_height(
    brdf: NDArray[np.float32],
    theta_r_deg: FloatArray,
    grid: CellGrid,
    pinhole: Pinhole,
    u_placement_mm: float,
) -> Height:
    """Return the height from BRDF (K, rows, columns) in 1/sr at views (K,), in degrees.

    Not known where the pictures tell it no better than a part of the rig's u of placement.
    Each picture is compared with the mean of those near the normal, slow changes apart.
    """
    near = np.abs(theta_r_deg) <= _NEAR_DEG
    if near.sum() < 1 or near.all() or min(brdf.shape[1:]) < 5 or not u_placement_mm:
        return Height(0.0, np.inf)
    height, u = 0.0, np.inf
    for _ in range(_ROUNDS):
        seen = np.stack(
            [
                at_height(image, theta, height, grid, pinhole)
                for image, theta in zip(brdf, theta_r_deg.tolist(), strict=True)
            ]
        )
        step, u = _step(seen, near, np.tan(np.radians(theta_r_deg)), grid.cell_mm)
        if not np.isfinite(step) or u > _LARGEST_U * u_placement_mm:
            return Height(0.0, np.inf)
        height += step
        if abs(height) > _MOST_U * u_placement_mm:
            return Height(0.0, np.inf)
        if abs(step) < _STEP_MM:
            break
    return Height(height, u)


def at_height(
    cells: NDArray[np.float32],
    theta_r_deg: float,
    height_mm: float,
    grid: CellGrid,
    pinhole: Pinhole,
) -> NDArray[np.float32]:
    """Return cells (rows, columns), rectified for a surface on the axis, for one at a height.

    In the unit of the cells; NaN where their neighbours have no value. The shift is along x; what
    lies beyond the sample's edge has no value, and rows move by microns.
    """
    import cv2

    if not height_mm:
        return cells
    from_cells = grid.to_mm()
    moved = (
        np.linalg.inv(pinhole.homography(theta_r_deg) @ from_cells)
        @ pinhole.homography(theta_r_deg, height_mm)
        @ from_cells
    )
    return np.asarray(
        cv2.warpPerspective(
            cells,
            moved,
            (grid.columns, grid.rows),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        ),
        dtype=np.float32,
    )


def smoothing(theta_r_deg: FloatArray, height_mm: float, cell_mm: float) -> FloatArray:
    """Return the factor (K,) by which `at_height` changes the variance of cells.

    Between two columns at a distance f from the first: f^2 + (1 - f)^2. Views in degrees.
    """
    shift = height_mm * np.tan(np.radians(theta_r_deg)) / cell_mm
    part = shift - np.floor(shift)
    return np.asarray(part**2 + (1 - part) ** 2)


def _step(
    seen: NDArray[np.float32], near: NDArray[np.bool_], tangent: FloatArray, cell_mm: float
) -> tuple[float, float]:
    """Return the change of the height in mm that suits the pictures best, and its u.

    Each picture is taken as the mean of the near ones, times a contrast, shifted, and a surface of
    second order: light and angles that change slowly over the sample.
    """
    known = np.isfinite(seen[near]).all(axis=0)
    mean = np.where(known, seen[near].mean(axis=0), np.nan).astype(np.float64)
    by_mm = np.gradient(mean, cell_mm, axis=1)
    slow = _slow_surfaces(mean.shape)
    top = bottom = 0.0
    for image, t in zip(seen, tangent.tolist(), strict=True):
        used = np.isfinite(image) & np.isfinite(by_mm)
        if np.count_nonzero(used) < _LEAST_CELLS:
            continue
        parts = np.column_stack([*(s[used] for s in slow), mean[used], by_mm[used]])
        parts /= np.maximum(np.linalg.norm(parts, axis=0), 1e-30)
        scale = max(float(np.linalg.norm(by_mm[used])), 1e-30)
        normal = parts.T @ parts
        if np.linalg.cond(normal) > _SINGULAR:
            continue
        contrast, shift = np.linalg.solve(normal, parts.T @ image[used])[-2:]
        contrast /= max(float(np.linalg.norm(mean[used])), 1e-30)
        left = image[used] - parts @ np.linalg.solve(normal, parts.T @ image[used])
        variance = float(np.mean(left**2)) * float(np.linalg.inv(normal)[-1, -1]) / scale**2
        if contrast <= 0 or variance <= 0:
            continue
        information = contrast**2 / variance
        top += information * t * float(shift) / scale / float(contrast)
        bottom += information * t * t
    return (top / bottom, float(bottom**-0.5)) if bottom > 0 else (np.nan, np.inf)


def _slow_surfaces(shape: tuple[int, ...]) -> list[FloatArray]:
    """Return the surfaces (rows, columns) of second order, dimensionless."""
    y, x = np.meshgrid(*(np.linspace(-1, 1, size) for size in shape), indexing="ij")
    return [np.ones(shape), x, y, x * x, x * y, y * y]
