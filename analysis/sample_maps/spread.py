"""Spread of a map over the sample: its mean, what it scatters beyond its u, and cells without fit.

A sample is uniform in a parameter where its cells scatter no more than their own uncertainties. The
mean curve of a sample that is not has no parameters of its own: a mixture of smooth and rough
places is not a surface of medium roughness.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from instrument.geometry import BoolArray, FloatArray, IntArray

# Beyond chance: a scatter or chi2 that is as seldom as a normal deviate of so many sigma.
_SEEN_SIGMA = 4.0
_REJECTED_SIGMA = 3.09  # one of 1000 cells of which the model holds
_LARGEST_U = 5.0  # of the median u
_LEAST_EXCESS = 0.05  # of the variance: no u is known better


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """Values of C cells in the parameter's unit: median, scatter, and what of it u explains.

    cells: number of those with a value and u. scatter: standard deviation. explained: root mean
    square of u. beyond: the part of the scatter that u does not explain, 0 for a uniform sample.
    uniform: the scatter is that of u.
    """

    cells: int
    median: float
    scatter: float
    explained: float
    beyond: float
    uniform: bool


def spread_of(values: FloatArray, u: FloatArray) -> Spread | None:
    """Return the spread of values (...) with their own u (...), in one unit; None for none.

    Cells whose value or u is NaN do not count, nor those whose u is far above the usual one, such
    as at the sample's edge; u is without what all cells share.
    """
    known = np.isfinite(values) & np.isfinite(u) & (u > 0)
    if np.count_nonzero(known) < 2:
        return None
    known &= u <= _LARGEST_U * np.median(u[known])
    own, u_own = values[known], u[known]
    weight = 1 / u_own**2
    mean = float(np.sum(own * weight) / np.sum(weight))
    chi2 = float(np.sum(np.square((own - mean) / u_own))) / (own.size - 1)
    seen = max(_SEEN_SIGMA * np.sqrt(2 / (own.size - 1)), _LEAST_EXCESS)
    scatter, explained = float(np.std(own, ddof=1)), float(np.sqrt(np.mean(u_own**2)))
    uniform = bool(chi2 - 1 <= seen)
    beyond = 0.0 if uniform else float(np.sqrt(max(scatter**2 - explained**2, 0.0)))
    return Spread(
        cells=own.size,
        median=float(np.median(own)),
        scatter=scatter,
        explained=explained,
        beyond=beyond,
        uniform=uniform,
    )


def rejected(chi2: FloatArray, dof: IntArray) -> BoolArray:
    """Return True for cells whose chi2 (...) with `dof` (...) is that of one in 1000, by chance.

    Dimensionless. Wilson and Hilferty 1931: the cube root of chi2 over dof is nearly normal. False
    for a cell without a fit.
    """
    free = np.maximum(dof, 1)
    part = 2 / (9 * free)
    with np.errstate(invalid="ignore"):
        deviate = (np.cbrt(chi2 / free) - (1 - part)) / np.sqrt(part)
    return np.isfinite(chi2) & (dof > 0) & (deviate > _REJECTED_SIGMA)
