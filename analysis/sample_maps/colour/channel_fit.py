"""Fit of all cells of a map in the three channels of a colour camera, with one sigma.

Noise differs from channel to channel. Errors of angles and places do not: three channels average
them no better than one. With relative variances n_c^2 by noise and r^2 in common, the mean of the
channels, each weighted by its noise, has 1 / sum(1 / n_c^2) + r^2. That is what independent
channels with n_c^2 (1 + r^2 sum(1 / n_c^2)) would have, which are fitted. The albedo of a channel
is by its own n_c^2 + r^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from analysis.sample_maps.block_fit import WORKERS, CellData, blocks_of
from analysis.sample_maps.cell_fit import CellFits, fit_channels
from analysis.sample_maps.colour.channel_misfit import channel_chi2
from analysis.sample_maps.places import TableField
from analysis.sample_maps.sigma_table import SigmaTable
from instrument.devices import CHANNELS
from instrument.geometry import FloatArray

_LEAST_NOISE = 1e-6  # of the variance in common: no cell is without noise
_OF_EACH, _OF_ALL = ("albedo", "ks"), ("sigma_deg",)


@dataclass(frozen=True, slots=True)
class ChannelCells:
    """Cells of one block: BRDF (N, K, C) in 1/sr of N channels, K geometries and C cells.

    noise: variance of that shape in 1/sr^2, independent in each channel. common: (J, N, K, C) in
    1/sr, shifts by one u of J errors that all channels of a geometry share.
    """

    brdf: FloatArray
    noise: FloatArray
    common: FloatArray

    @classmethod
    def of(cls, data: Sequence[CellData], rows: slice, columns: slice) -> ChannelCells:
        """Return the cells of a block, from those of each channel."""
        brdf = np.stack([d.block(rows, columns)[0] for d in data])
        each = list(zip(data, brdf, strict=True))
        common = np.stack([d.in_common(y, rows, columns) for d, y in each], axis=1)
        least = _LEAST_NOISE * np.sum(common**2, axis=0)
        return cls(brdf, np.maximum(np.stack([d.noise(y) for d, y in each]), least), common)

    def fitted(self, table: SigmaTable) -> list[CellFits]:
        """Return the fits of each channel, with one sigma; chi2 is that of the substitute."""
        common = np.sum(self.common**2, axis=0)
        variance = self.noise * (1 + np.nansum(common / self.noise, axis=0))
        weight = np.nan_to_num(self.brdf**2 / variance)
        true = np.nan_to_num((self.noise + common) / variance)
        total = np.maximum(weight.sum(axis=1), 1e-300)
        share = (weight * true).sum(axis=1) / total
        return fit_channels(table, list(self.brdf), list(variance), list(share))

    def judged(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return BRDF and noise (N, K, C), and what channels share (1, N, K, C), for the misfit.

        What a place and the blur of an edge do is known in size alone, from pictures that are not
        grazing: which channel they move more is not, and counts as independent.
        """
        beside = np.sum(self.common[1:] ** 2, axis=0)
        return self.brdf, self.noise + beside, self.common[:1]


def fit_channel_blocks(
    data: Sequence[CellData], tables: TableField, distance_mm: float
) -> dict[str, FloatArray]:
    """Return maps (rows, columns) by name, in their units: `albedo_r`, `u_albedo_r`, `sigma_deg`.

    data: of each channel in the order of `CHANNELS`, at the same places. distance_mm: that of the
    nearer one of lamp and camera. count: of values, in all channels together.
    """
    shape = data[0].brdf.shape[1:]
    found = {name: np.full(shape, np.nan) for name in _names()}

    def fit(block: tuple[slice, slice]) -> None:
        rows, columns = block
        x_mm, y_mm = data[0].x_mm[columns].mean(), data[0].y_mm[rows].mean()
        table = tables.at(float(x_mm), float(y_mm))
        cells = ChannelCells.of(data, rows, columns)
        fits, shared = cells.fitted(table), [d.shared_of(rows, columns) for d in data]
        chi2 = channel_chi2(table, fits, cells.judged(), shared)
        for name, values in {**_by_name(fits), "chi2": chi2}.items():
            own = found[name][rows, columns]
            own[...] = values.reshape(own.shape)

    with ThreadPoolExecutor(WORKERS) as pool:
        for _ in pool.map(fit, blocks_of(data[0], distance_mm)):
            pass
    return found


def _names() -> list[str]:
    own = [f"{name}_{channel}" for channel in CHANNELS for name in _OF_EACH]
    return [*(f"{u}{name}" for name in (*own, *_OF_ALL) for u in ("", "u_")), "chi2", "count"]


def _by_name(fits: Sequence[CellFits]) -> dict[str, FloatArray]:
    """Return the fits (C,) by the names of a map."""
    found = {
        f"{u}{name}_{channel}": getattr(own, f"{u}{name}")
        for channel, own in zip(CHANNELS, fits, strict=True)
        for name in _OF_EACH
        for u in ("", "u_")
    }
    first = fits[0]
    return {
        **found,
        "sigma_deg": first.sigma_deg,
        "u_sigma_deg": first.u_sigma_deg,
        "count": first.count.astype(np.float64),
    }
