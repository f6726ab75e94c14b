"""Agreement of several runs at the same geometries, with errors that runs share treated as shared.

The BRDF at each of G geometries is unknown. Minimised over it, the squared deviations of K runs
from it, in units of their uncertainty, follow chi² with (K - 1) G degrees of freedom if the runs
agree within that uncertainty (GUM; generalised least squares). Errors that a run's points share,
and those that runs share, such as the certificate of one white tile, are unknowns of their own with
the u that is stated: the same error in all runs cannot make them disagree.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.data.covariance import Covariance
from instrument.geometry import FloatArray

DISAGREE = 0.01
"""Probability below which runs that agree would seldom differ as much."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Values:
    """One run at the G geometries: brdf (G,) in 1/sr, its covariance, and its model there.

    model: (G,) in 1/sr, of the run's best model, for relative errors and ratios.
    """

    brdf: FloatArray
    covariance: Covariance
    model: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Test:
    """chi² with its degrees of freedom, and the probability of a larger one if runs agree."""

    chi2: float
    dof: int

    @property
    def probability(self) -> float:
        """Probability of a larger chi² for runs that agree; 1 without a degree of freedom."""
        from scipy.special import gammaincc

        return float(gammaincc(self.dof / 2, self.chi2 / 2)) if self.dof else 1.0

    @property
    def agrees(self) -> bool:
        """True unless the runs differ by more than their uncertainties explain."""
        return self.probability >= DISAGREE


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """Outcome for K runs at G geometries.

    whole: of the values as they are. shape: with a factor for each run but the first left free.
    factors, u_factors: (K,), level of each run relative to the first, and its standard uncertainty
    with all shared errors, 0 for the first. difference: (K, G) in 1/sr, to the first run.
    u_difference: (K, G) in 1/sr, its standard uncertainty, in which errors that both share cancel.
    scatter: (G,), standard deviation of the runs relative to their mean. u_scatter: (G,), that
    which the independent parts of u explain.
    """

    whole: Test
    shape: Test
    factors: FloatArray
    u_factors: FloatArray
    difference: FloatArray
    u_difference: FloatArray
    scatter: FloatArray
    u_scatter: FloatArray


def agreement(runs: Sequence[Values], same: Collection[str] = ()) -> Agreement:
    """Compare K >= 2 runs at the same G >= 1 geometries.

    same: names of errors that are one and the same in all runs that have them; a column of a
    covariance belongs to one if its name begins with it.
    """
    y, variance = np.stack([r.brdf for r in runs]), np.stack([r.covariance.variance for r in runs])
    common = joint_columns([r.covariance for r in runs], same)
    joint = Covariance(variance.ravel(), _centred(common, 1 / variance))
    d = joint.whiten(_centred(y.reshape(-1, 1), 1 / variance)[:, 0])
    levels = joint.whiten(_centred(_level_columns([r.model for r in runs]), 1 / variance))
    inverse = np.linalg.pinv(levels.T @ levels)
    excess = inverse @ (levels.T @ d)
    rest = d - levels @ excess
    u_excess = np.sqrt(np.diag(inverse))
    runs_n, geometries = y.shape
    mean = y.mean(axis=0)
    return Agreement(
        whole=Test(chi2=float(d @ d), dof=(runs_n - 1) * geometries),
        shape=Test(chi2=float(rest @ rest), dof=(runs_n - 1) * (geometries - 1)),
        factors=np.concatenate([[1.0], 1 + excess]),
        u_factors=np.concatenate([[0.0], u_excess]),
        difference=y - y[0],
        u_difference=_u_difference(variance, common.reshape(runs_n, geometries, -1)),
        scatter=np.std(y, axis=0, ddof=1) / np.abs(mean),
        u_scatter=np.sqrt(variance.mean(axis=0)) / np.abs(mean),
    )


def joint_columns(covariances: Sequence[Covariance], same: Collection[str]) -> FloatArray:
    """Return the shared errors of all K runs together, shape (K G, M), in 1/sr by one u.

    A run's own error shifts its own points alone. Errors named in `same` are one column.
    """
    shape = len(covariances), covariances[0].variance.size
    columns: dict[object, FloatArray] = {}
    for k, covariance in enumerate(covariances):
        own = covariance.common
        dense = own if isinstance(own, np.ndarray) else own.toarray()
        for n, name in enumerate(covariance.names):
            shared = any(name.startswith(word) for word in same)
            column = columns.setdefault(name if shared else (k, n), np.zeros(shape))
            column[k] += dense[:, n]
    if not columns:
        return np.zeros((shape[0] * shape[1], 0))
    return np.stack([c.ravel() for c in columns.values()], axis=-1)


def _centred(columns: FloatArray, weight: FloatArray) -> FloatArray:
    """Columns (K G, M) less their mean over the runs at each geometry, by weights (K, G)."""
    blocks = columns.reshape(*weight.shape, -1)
    w = weight[:, :, np.newaxis]
    centred = blocks - np.sum(w * blocks, axis=0) / np.sum(w, axis=0)
    return np.asarray(centred.reshape(columns.shape))


def _level_columns(models: Sequence[FloatArray]) -> FloatArray:
    """Change (K G, K - 1) of all values by the factor of each run but the first."""
    columns = np.zeros((len(models), models[0].size, len(models) - 1))
    for k, model in enumerate(models[1:], start=1):
        columns[k, :, k - 1] = model
    return columns.reshape(-1, len(models) - 1)


def _u_difference(variance: FloatArray, common: FloatArray) -> FloatArray:
    """Standard uncertainty (K, G) of each run minus the first; 0 for the first."""
    shared = np.sum(np.square(common - common[0]), axis=-1)
    u: FloatArray = np.sqrt(variance + variance[0] + shared)
    u[0] = 0.0
    return u
