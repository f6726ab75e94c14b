"""Misfit of cells beyond errors that all of them share: angles, tile, lamp, height of the surface.

Least squares with the covariance V + S S^T (GUM; Cox and Harris), V that of a cell by itself and S
the shifts by one u of each shared error. Their fits are found with V alone, which hardly changes
them; chi2 counts with both, or a cell of little noise is blamed for an angle that is a little off.
"""

from __future__ import annotations

import numpy as np

from analysis.sample_maps.cell_fit import CellFits
from analysis.sample_maps.sigma_table import SigmaTable
from instrument.geometry import BoolArray, FloatArray

_POINTS = 5  # of the table, through which a polynomial goes
_TO_COEFFICIENTS = np.linalg.inv(np.vander(np.arange(_POINTS) - 2, increasing=True))
_STEP = 0.1  # places of the table, for the derivative by sigma
_TINY = 1e-9


def chi2_beyond_shared(
    table: SigmaTable, fits: CellFits, brdf: FloatArray, variance: FloatArray, shared: FloatArray
) -> FloatArray:
    """Return chi2 (C,) of fits of brdf (K, C) in 1/sr, with variance (K, C) in 1/sr^2.

    shared: (K, M), relative shifts of a curve by one u of each shared error. The answer of the fits
    is taken as that of a usual cell: the cells are near one another.
    """
    known = np.isfinite(fits.chi2)
    usable = np.isfinite(brdf) & np.isfinite(variance) & (variance > 0) & known
    if not usable.any():
        return fits.chi2
    u = np.sqrt(np.where(usable, variance, np.inf))
    left = np.where(usable, brdf - model_of(table, fits, known), 0.0) / u
    cells = np.maximum(usable.sum(axis=1), 1)
    level, per_u = np.where(usable, brdf / u, 0.0).sum(axis=1) / cells, (1 / u).sum(axis=1) / cells
    own = by_parameter(table, fits, known) * per_u[:, np.newaxis]
    moves = np.hstack([own, shared * level[:, np.newaxis]])
    return np.where(known, chi2_without(moves, own.shape[1], left), np.nan)


def chi2_without(moves: FloatArray, free: int, left: FloatArray) -> FloatArray:
    """Return chi2 (C,) of what is left (N, C), in units of its u, beyond moves (N, M).

    The first `free` moves have any size, each of the others about 1.
    """
    product = moves.T @ moves
    prior = np.r_[_TINY * np.diagonal(product)[:free], np.ones(moves.shape[1] - free)]
    seen = moves.T @ left
    explained = np.sum(seen * np.linalg.solve(product + np.diag(prior), seen), axis=0)
    return np.asarray(np.maximum(np.sum(left**2, axis=0) - explained, 0.0))


def model_of(table: SigmaTable, fits: CellFits, known: BoolArray) -> FloatArray:
    """Return the BRDF (K, C) in 1/sr of each cell's fit, 0 for cells without one."""
    place = table.place_of(np.where(known, fits.sigma_deg, table.sigma_deg[0]))
    at = _weights(place, table.sigma_deg.size)
    albedo, ks = (np.where(known, values, 0.0) for values in (fits.albedo, fits.ks))
    model = table.once.T @ (at * albedo) + table.twice.T @ (at * albedo**2)
    if table.lobe is not None:
        model = model + table.lobe.T @ (at * ks)
    return np.asarray(model)


def _weights(place: FloatArray, size: int) -> FloatArray:
    """Return the weight (size, C) of each value of a table at places (C,) in it."""
    first = np.clip(np.rint(place).astype(np.int64) - 2, 0, size - _POINTS)
    powers = (place - first - 2) ** np.arange(_POINTS)[:, np.newaxis]
    weights = np.zeros((size, place.size))
    rows = first + np.arange(_POINTS)[:, np.newaxis]
    weights[rows, np.arange(place.size)] = _TO_COEFFICIENTS.T @ powers
    return weights


def by_parameter(table: SigmaTable, fits: CellFits, known: BoolArray) -> FloatArray:
    """Return the derivatives (K, P) of a usual cell's BRDF, in 1/sr by the parameters' units."""
    albedo, sigma, ks = (
        float(np.median(getattr(fits, name)[known])) for name in ("albedo", "sigma_deg", "ks")
    )
    place = table.place_of(np.array([sigma]))
    last = table.sigma_deg.size - 1
    at, *ends = (
        _weights(np.clip(place + step, 0, last), last + 1)[:, 0] for step in (0, -_STEP, _STEP)
    )
    own = [(table.once + 2 * albedo * table.twice).T @ at]
    whole = albedo * table.once + albedo**2 * table.twice
    if table.lobe is not None:
        own.append(table.lobe.T @ at)
        whole = whole + ks * table.lobe
    own.append(whole.T @ (ends[1] - ends[0]))
    return np.stack(own, axis=1)
