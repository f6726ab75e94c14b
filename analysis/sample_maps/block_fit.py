"""Fit of all cells of a map, in blocks that are small enough to have one set of angles each."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from analysis.sample_maps.cell_fit import CellFits, fit_cells
from analysis.sample_maps.places import TableField
from analysis.sample_maps.shared_misfit import chi2_beyond_shared
from instrument.geometry import FloatArray

_LARGEST_ANGLE = 0.1  # degrees, from the middle of a block to its side
_MOST_CELLS = 32  # along a side: their sums stay in the processor's cache
WORKERS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class CellData:
    """BRDF of cells: brdf (K, rows, columns) in 1/sr, NaN where a cell has none.

    x_mm (columns,), y_mm (rows,): places. floor, per_brdf, relative: (K,) each; the variance of a
    value is floor + per_brdf * brdf + (relative * brdf)^2, in 1/sr^2. texture (rows, columns):
    relative change of the light for each mm beside a cell, which the u of its place in each
    picture, place_mm (K,), turns into a u of its own. bend (rows, columns): relative difference of
    a cell from the mean of its two neighbours along x, of which each picture shows the share
    blur (K,). shared (K, M): relative shifts of all cells
    by one u of each error that they share, beside shared_mm (K,), that of their place.
    """

    brdf: NDArray[np.float32]
    x_mm: FloatArray
    y_mm: FloatArray
    floor: FloatArray
    per_brdf: FloatArray
    relative: FloatArray
    texture: FloatArray | None = None
    place_mm: FloatArray | None = None
    bend: FloatArray | None = None
    blur: FloatArray | None = None
    shared: FloatArray | None = None
    shared_mm: FloatArray | None = None

    def block(self, rows: slice, columns: slice) -> tuple[FloatArray, FloatArray]:
        """Return BRDF (K, C) in 1/sr of the block's cells, and its variance (K, C)."""
        own = self.brdf[:, rows, columns]
        brdf = own.reshape(own.shape[0], -1).astype(np.float64)
        variance = self.variance(brdf)
        if self.texture is not None and self.place_mm is not None:
            variance += (np.outer(self.place_mm, self.texture[rows, columns]) * brdf) ** 2
        if self.bend is not None and self.blur is not None:
            variance += (np.outer(self.blur, self.bend[rows, columns]) * brdf) ** 2
        return brdf, variance

    def noise(self, brdf: FloatArray) -> FloatArray:
        """Return the part of the variance, in 1/sr^2, by photons and read-out, of (K, C) in 1/sr.

        The rest is that of `in_common`.
        """
        floor, per_brdf = self.floor[:, np.newaxis], self.per_brdf[:, np.newaxis]
        return np.asarray(floor + per_brdf * np.maximum(brdf, 0.0))

    def in_common(self, brdf: FloatArray, rows: slice, columns: slice) -> FloatArray:
        """Return shifts (3, K, C), in 1/sr, of a block's BRDF (K, C) by one u of what it shares.

        With other channels of the same picture: by the angles, the place, and the pixels' blur. The
        sign tells whether two channels rise together.
        """
        count = brdf.shape[1]
        shifts = [np.broadcast_to(self.relative[:, np.newaxis], brdf.shape)]
        for u, slope in ((self.place_mm, self.texture), (self.blur, self.bend)):
            if u is None or slope is None:
                shifts.append(np.zeros((1, count)))
            else:
                shifts.append(np.outer(u, slope[rows, columns]))
        return np.stack([shift * brdf for shift in shifts])

    def shared_of(self, rows: slice, columns: slice) -> FloatArray | None:
        """Return the relative shifts (K, M) of the block's cells by all that cells share."""
        if self.shared is None or self.texture is None or self.shared_mm is None:
            return self.shared
        slope = float(np.median(self.texture[rows, columns]))
        return np.column_stack([self.shared, slope * self.shared_mm])

    def variance(self, brdf: FloatArray) -> FloatArray:
        """Return the variance, in 1/sr^2, of values (K,) or (K, C) in 1/sr."""
        floor, per_brdf, relative = (
            a if brdf.ndim == 1 else a[:, np.newaxis]
            for a in (self.floor, self.per_brdf, self.relative)
        )
        return np.asarray(floor + per_brdf * np.maximum(brdf, 0.0) + np.square(relative * brdf))


def fit_blocks(data: CellData, tables: TableField, distance_mm: float) -> dict[str, FloatArray]:
    """Return the fields of `CellFits` as maps (rows, columns) by name, in their units.

    distance_mm: that of the nearer one of lamp and camera.
    """
    shape = data.brdf.shape[1:]
    found = {field.name: np.full(shape, np.nan) for field in fields(CellFits)}

    def fit(block: tuple[slice, slice]) -> None:
        rows, columns = block
        table = tables.at(float(data.x_mm[columns].mean()), float(data.y_mm[rows].mean()))
        brdf, variance = data.block(rows, columns)
        fits, shared = fit_cells(table, brdf, variance), data.shared_of(rows, columns)
        if shared is not None:
            fits = replace(fits, chi2=chi2_beyond_shared(table, fits, brdf, variance, shared))
        for name, values in found.items():
            own = values[rows, columns]
            own[...] = getattr(fits, name).reshape(own.shape)

    with ThreadPoolExecutor(WORKERS) as pool:
        for _ in pool.map(fit, blocks_of(data, distance_mm)):
            pass
    return found


def blocks_of(data: CellData, distance_mm: float) -> Iterator[tuple[slice, slice]]:
    """Yield rows and columns of blocks, so small that angles hardly differ within one."""
    cell_mm = abs(float(data.x_mm[1] - data.x_mm[0])) if data.x_mm.size > 1 else 1.0
    side_mm = 2 * np.radians(_LARGEST_ANGLE) * distance_mm
    side = int(np.clip(side_mm / cell_mm, 1, _MOST_CELLS))
    rows, columns = data.brdf.shape[1:]
    for row in range(0, rows, side):
        for column in range(0, columns, side):
            yield slice(row, row + side), slice(column, column + side)
