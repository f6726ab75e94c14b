"""Misfit of cells in several channels, beyond errors that channels of a geometry or cells share.

The covariance of the channels of a geometry is D + G G^T: D their noise, and G their shifts by the
errors that they share. In units of the noise it is I + V V^T = L L^T (Cholesky); residuals that are
solved by L are independent, of variance 1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from analysis.sample_maps.cell_fit import CellFits
from analysis.sample_maps.shared_misfit import by_parameter, chi2_without, model_of
from analysis.sample_maps.sigma_table import SigmaTable
from instrument.geometry import BoolArray, FloatArray


def channel_chi2(
    table: SigmaTable,
    fits: Sequence[CellFits],
    cells: tuple[FloatArray, FloatArray, FloatArray],
    shared: Sequence[FloatArray | None],
) -> FloatArray:
    """Return chi2 (C,) of the fits of N channels, over all their values.

    cells: BRDF in 1/sr and its variance by noise in 1/sr^2, (N, K, C) each, and shifts (J, N, K, C)
    in 1/sr by one u of what the channels share. shared: (K, M) of each channel, relative shifts of
    a curve by one u of each error that all cells share; None for none.
    """
    brdf, noise, common = cells
    known = np.isfinite(fits[0].chi2)
    usable = np.isfinite(brdf) & np.isfinite(noise) & (noise > 0) & known
    if not usable.any():
        return fits[0].chi2
    u = np.sqrt(np.where(usable, noise, np.inf))
    model = np.stack([model_of(table, own, known) for own in fits])
    left = np.where(usable, brdf - model, 0.0) / u
    together = np.where(usable, common, 0.0) / u
    left = independent(left, together)
    moves, free = _moves(table, fits, known, (usable, u, brdf, together), shared)
    count = brdf.shape[-1]
    return np.where(known, chi2_without(moves, free, left.reshape(-1, count)), np.nan)


def independent(values: FloatArray, together: FloatArray) -> FloatArray:
    """Return values (N, K, C), in units of their noise, made independent of each other.

    together: (J, N, K, C) or such as is broadcast to it, in the same unit: shifts by one u of each
    error that the N values share.
    """
    lower: dict[tuple[int, int], FloatArray] = {}
    found: list[FloatArray] = []
    for i, own in enumerate(values):
        rest = own
        for j in range(i):
            product = np.sum(together[:, i] * together[:, j], axis=0)
            for m in range(j):
                product = product - lower[i, m] * lower[j, m]
            lower[i, j] = product / lower[j, j]
            rest = rest - lower[i, j] * found[j]
        square = 1 + np.sum(together[:, i] ** 2, axis=0)
        for m in range(i):
            square = square - lower[i, m] ** 2
        lower[i, i] = np.sqrt(square)
        found.append(rest / lower[i, i])
    return np.stack(found)


def _moves(
    table: SigmaTable,
    fits: Sequence[CellFits],
    known: BoolArray,
    cells: tuple[BoolArray, FloatArray, FloatArray, FloatArray],
    shared: Sequence[FloatArray | None],
) -> tuple[FloatArray, int]:
    """Return the moves (N K, P + M) of a usual cell by its parameters, and by shared errors; and P.

    cells: usable, u by noise and BRDF, (N, K, C) each, and what the channels share in units of u.
    """
    usable, u, brdf, together = cells
    count = np.maximum(usable.sum(axis=-1), 1)
    level, per_u, usual = (
        np.where(usable, a, 0.0).sum(axis=-1) / count for a in (brdf / u, 1 / u, together)
    )
    each = [by_parameter(table, own, known) for own in fits]
    channels, views, linear = len(fits), each[0].shape[0], each[0].shape[1] - 1
    moves = np.zeros((channels, views, channels * linear + 1))
    for n, values in enumerate(each):
        moves[n, :, n * linear : (n + 1) * linear] = values[:, :-1]
        moves[n, :, -1] = values[:, -1]  # of sigma
    moves *= per_u[..., np.newaxis]
    errors = [own for own in shared if own is not None]
    if errors:
        moves = np.concatenate([moves, np.stack(errors) * level[..., np.newaxis]], axis=-1)
    whole = independent(moves, usual[..., np.newaxis])
    return whole.reshape(channels * views, -1), channels * linear + 1
