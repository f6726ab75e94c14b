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
from instrument.geometry import BoolArray, FloatArray, IntArray

DISAGREE = 0.01
"""Probability below which runs that agree would seldom differ as much."""

_LEAST = 1e-9  # singular value of columns, relative to the largest, above which it is no rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class Values:
    """One run at the G geometries: brdf (G,) in 1/sr, its covariance, and its model there.

    model: (G,) in 1/sr, of the run's best model, for relative errors and ratios. settings: (G,),
    where the values are relative to a level of each lamp setting, the number of that setting; None:
    the run has one level.
    """

    brdf: FloatArray
    covariance: Covariance
    model: FloatArray
    settings: IntArray | None = None


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

    whole: of the values as they are. shape: with a factor for each run but the first left free, and
    for each lamp setting of `Values.settings`. factors, u_factors: (K,), level of each run relative
    to the first, and its standard uncertainty with all shared errors, 0 for the first; NaN where
    runs have a level of each lamp setting. excess: (M,), how far each of the M free levels is above
    1, in the order of the runs and of `level_points`. difference: (K, G) in 1/sr, to the first run.
    u_difference: (K, G) in 1/sr, its standard uncertainty, in which errors that both share cancel.
    scatter: (G,), standard deviation of the runs relative to their mean. u_scatter: (G,), that
    which the independent parts of u explain.
    """

    whole: Test
    shape: Test
    excess: FloatArray
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
    levels = joint.whiten(_centred(_level_columns(runs), 1 / variance))
    inverse = np.linalg.pinv(levels, rcond=_LEAST)
    excess = inverse @ d
    rest = d - levels @ excess
    runs_n, geometries = y.shape
    dof = (runs_n - 1) * geometries
    factors, u_factors = _factors(runs, excess, np.linalg.norm(inverse, axis=1))
    mean = y.mean(axis=0)
    return Agreement(
        whole=Test(chi2=float(d @ d), dof=dof),
        shape=Test(chi2=float(rest @ rest), dof=dof - _rank(levels)),
        excess=excess,
        factors=factors,
        u_factors=u_factors,
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
        dense = covariance.common_dense
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


def _level_columns(runs: Sequence[Values]) -> FloatArray:
    """Change (K G, M) of all values by each free level, in the order of `level_points`."""
    models = [run.model for run in runs]
    if any(run.settings is not None for run in runs):
        # One for all: a level that all runs change alike then drops out, as nothing tells it.
        models = [np.mean(models, axis=0)] * len(runs)
    columns = []
    for k, run in enumerate(runs):
        for points in level_points(run, first=k == 0):
            column = np.zeros((len(runs), run.brdf.size))
            column[k, points] = models[k][points]
            columns.append(column.ravel())
    return np.stack(columns, axis=-1)


def level_points(run: Values, *, first: bool) -> list[BoolArray]:
    """Masks (G,), without unit, of the points of each free level; of the `first`, of settings."""
    if run.settings is None:
        return [] if first else [np.ones(run.brdf.size, dtype=np.bool_)]
    return [run.settings == setting for setting in np.unique(run.settings)]


def _factors(
    runs: Sequence[Values], excess: FloatArray, u_excess: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Level (K,) of each run relative to the first, and its u; NaN with levels of settings."""
    if any(run.settings is not None for run in runs):
        unknown = np.full(len(runs), np.nan)
        return unknown, unknown
    return np.concatenate([[1.0], 1 + excess]), np.concatenate([[0.0], u_excess])


def _rank(columns: FloatArray) -> int:
    """Number of levels that can be told apart."""
    sizes = np.linalg.svd(columns, compute_uv=False)
    return int(np.sum(sizes > _LEAST * np.max(sizes, initial=0.0)))


def _u_difference(variance: FloatArray, common: FloatArray) -> FloatArray:
    """Standard uncertainty (K, G) of each run minus the first; 0 for the first."""
    shared = np.sum(np.square(common - common[0]), axis=-1)
    u: FloatArray = np.sqrt(variance + variance[0] + shared)
    u[0] = 0.0
    return u
