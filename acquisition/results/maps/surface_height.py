"""Height of the sample's surface above the rotation axis, found from its texture.

A surface at a height h is seen h tan(theta_r) beside its place. A fifth of a millimetre moves the
cells by one millimetre at 80 degrees: their curves would mix. The sample's own texture shows the
shift. Where the sample has none, a shift changes nothing either.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.measure.rectify.cell_grid import CellGrid
from instrument.geometry import FloatArray, IntArray
from instrument.pinhole import Pinhole

_ROUNDS, _STEP_MM = 6, 0.005  # a smaller change ends the search
_FIRST, _LEAST_SEEN = 0.25, 0.1  # first height, of the placement; share of a shift that is seen
_NEAR_DEG = 35.0  # views up to here show the texture at its place
_NEAR, _FAR = 3, 8  # pictures that are compared, of those and of the others
_LARGEST_U, _MOST_U = 0.25, 8.0  # of the placement: u of a height, and a height
_LEAST_CELLS, _LEAST_PICTURES, _SINGULAR = 100, 3, 1e10


@dataclass(frozen=True, slots=True)
class Height:
    """Height in mm with its standard uncertainty; 0 with u = inf where no texture shows it."""

    mm: float
    u_mm: float


def searched_views(theta_r_deg: FloatArray) -> IntArray:
    """Return the numbers of the views to compare, out of (K,) in degrees, near ones first."""
    by_size = np.argsort(np.abs(theta_r_deg), kind="stable")
    near = np.abs(theta_r_deg) <= _NEAR_DEG
    others = np.flatnonzero(~near)[np.argsort(theta_r_deg[~near], kind="stable")]
    even = np.linspace(0, others.size - 1, min(_FAR, others.size)).round().astype(np.int64)
    return np.concatenate([by_size[: min(_NEAR, int(near.sum()))], others[even]])


def find_height(
    light: Callable[[float], NDArray[np.float32]],
    theta_r_deg: FloatArray,
    cell_mm: float,
    u_placement_mm: float,
) -> Height:
    """Return the height that views (K,), in degrees, show.

    light: returns the light of each cell, (K, rows, columns) and of about one size in all views, of
    a surface at a height in mm. Not known where the pictures tell it no better than a part of the
    rig's u of placement. Each picture is compared with the mean of those near the normal, slow
    changes apart.
    """
    near = np.abs(theta_r_deg) <= _NEAR_DEG
    if not near.any() or near.all() or not u_placement_mm:
        return Height(0.0, np.inf)
    tangent = np.tan(np.radians(theta_r_deg))

    def missing(height_mm: float) -> tuple[float, float]:
        return _step(light(height_mm), near, tangent, cell_mm)

    before, (last, u) = 0.0, missing(0.0)
    height = float(np.copysign(max(abs(last), _FIRST * u_placement_mm), last))
    for _ in range(_ROUNDS):
        if not abs(height) <= _MOST_U * u_placement_mm:
            break
        step, u = missing(height)
        seen = (last - step) / (height - before)  # of a shift: edges show more, noise hides some
        if not seen > _LEAST_SEEN or u > _LARGEST_U * u_placement_mm * seen:
            break
        before, last = height, step
        height += step / seen
        if abs(height - before) < _STEP_MM:
            return Height(height, u / seen)
    return Height(0.0, np.inf)


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

    The u is that of noise, or of the scatter of the pictures' own heights where that is larger:
    what else differs between pictures, such as light that changes fast over the sample.
    """
    found = [own for own in _of_pictures(seen, near, cell_mm) if own[2] > 0]
    if len(found) < _LEAST_PICTURES:
        return np.nan, np.inf
    number, shift, information = np.array(found).T
    t = tangent[number.astype(np.int64)]
    step = float(np.sum(information * t * shift) / np.sum(information * t * t))
    chi2 = float(np.sum(information * (shift - step * t) ** 2)) / (len(found) - 1)
    return step, float(np.sqrt(max(chi2, 1.0) / np.sum(information * t * t)))


def _of_pictures(
    seen: NDArray[np.float32], near: NDArray[np.bool_], cell_mm: float
) -> Iterator[tuple[int, float, float]]:
    """Yield number, shift in mm and its information in 1/mm^2 of each picture that has texture.

    Each picture is taken as the mean of the near ones, times a contrast, shifted, and a surface of
    second order: light and angles that change slowly over the sample.
    """
    known = np.isfinite(seen[near]).all(axis=0)
    mean = np.where(known, seen[near].mean(axis=0), np.nan).astype(np.float64)
    by_mm = np.gradient(mean, cell_mm, axis=1)
    slow = _slow_surfaces(mean.shape)
    for number, image in enumerate(seen):
        used = np.isfinite(image) & np.isfinite(by_mm)
        if np.count_nonzero(used) < _LEAST_CELLS:
            continue
        parts = np.column_stack([*(s[used] for s in slow), mean[used], by_mm[used]])
        norms = np.maximum(np.linalg.norm(parts, axis=0), 1e-30)
        parts /= norms
        normal = parts.T @ parts
        if np.linalg.cond(normal) > _SINGULAR:
            continue
        solved = np.linalg.solve(normal, parts.T @ image[used])
        contrast, moved = (solved / norms)[-2:].tolist()
        rest = float(np.mean((image[used] - parts @ solved) ** 2))
        variance = rest * float(np.linalg.inv(normal)[-1, -1]) / norms[-1] ** 2
        if contrast > 0 and variance > 0:
            yield number, moved / contrast, contrast**2 / variance


def _slow_surfaces(shape: tuple[int, ...]) -> list[FloatArray]:
    """Return the surfaces (rows, columns) of second order, dimensionless."""
    y, x = np.meshgrid(*(np.linspace(-1, 1, size) for size in shape), indexing="ij")
    return [np.ones(shape), x, y, x * x, x * y, y * y]
