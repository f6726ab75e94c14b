"""Exact fraction of each pixel that a polygon covers, by Green's theorem on the pixel grid.

Each edge is cut at the pixel borders that it crosses; every piece adds its signed height to its
pixel and to all pixels right of it. One cumulative sum along the rows then gives the area.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from instrument.geometry import FloatArray


@dataclass(frozen=True, slots=True)
class Coverage:
    """Covered fraction (rows, columns) of each pixel, 0 to 1, in a crop from (row, column)."""

    row: int
    column: int
    fraction: FloatArray
    inside_frame: bool

    @property
    def crop(self) -> tuple[slice, slice]:
        """Slices of the image, rows and columns, that `fraction` belongs to."""
        rows, columns = self.fraction.shape
        return slice(self.row, self.row + rows), slice(self.column, self.column + columns)


def polygon_coverage(polygon_px: FloatArray, width_px: int, height_px: int) -> Coverage:
    """Return the coverage of a simple polygon, clipped at the edges of the image.

    `polygon_px`: corners (N, 2) in pixels as (column, row). `inside_frame` of the result is True if
    the whole polygon lies in the image. A polygon outside the image gives an empty crop.
    """
    corners = np.asarray(polygon_px, dtype=np.float64) + 0.5  # pixel n now covers n to n + 1
    size = np.array([width_px, height_px])
    inside = bool(np.all(corners >= 0) and np.all(corners <= size))
    first = np.clip(np.floor(corners.min(axis=0)), 0, size).astype(int)
    last = np.clip(np.ceil(corners.max(axis=0)), first, size).astype(int)
    columns, rows = last - first
    corners = corners - first
    sums = np.zeros((rows, columns + 1))
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        _add_edge(sums, start, end)
    fraction = np.abs(np.cumsum(sums[:, :columns], axis=1))
    return Coverage(int(first[1]), int(first[0]), np.minimum(fraction, 1.0), inside)


def _add_edge(sums: FloatArray, start: FloatArray, end: FloatArray) -> None:
    """Add the signed heights of one edge; `sums` has one spare column on the right."""
    rows, columns = sums.shape[0], sums.shape[1] - 1
    cuts = _cuts(start, end, columns, rows)
    points = start + np.outer(cuts, end - start)
    middle = (points[:-1] + points[1:]) / 2
    height = np.diff(points[:, 1])
    keep = (middle[:, 1] > 0) & (middle[:, 1] < rows)
    x = np.clip(middle[keep, 0], 0.0, columns)  # left of the crop: in full; right: nothing
    row = middle[keep, 1].astype(int)
    column = np.minimum(x.astype(int), columns - 1) if columns else x.astype(int)
    part = x - column
    np.add.at(sums, (row, column), height[keep] * (1 - part))
    if columns:
        np.add.at(sums, (row, column + 1), height[keep] * part)


def _cuts(start: FloatArray, end: FloatArray, columns: int, rows: int) -> FloatArray:
    """Return the parameters 0 to 1 at which an edge enters another pixel, both ends included."""
    cuts = [np.array([0.0, 1.0])]
    for axis, size in ((0, columns), (1, rows)):
        if start[axis] != end[axis]:
            low, high = sorted((start[axis], end[axis]))
            lines = np.arange(max(np.ceil(low), 0), min(np.floor(high), size) + 1)
            cuts.append((lines - start[axis]) / (end[axis] - start[axis]))
    return np.unique(np.clip(np.concatenate(cuts), 0.0, 1.0))
