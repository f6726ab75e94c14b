"""Outliers: a few scattered points without which a model explains the data.

The points are found by a short robust fit of the models nearest to most of the data, and the claim
is tested by a usual fit without them. They stay in the data: this is only a suggestion.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from analysis.choice.adequacy import agreement
from analysis.choice.checks.relative_size import relative_size
from analysis.choice.runs_test import runs_probability
from analysis.data.acceptance import Acceptance
from analysis.data.measurements import Measurements
from analysis.data.sweeps import sweeps
from analysis.fit.criteria import SIGNIFICANCE
from analysis.fit.first_fit import FirstFit, FirstFits
from analysis.fit.fit import FitResult, refine
from analysis.fit.search.levenberg_marquardt import HUBER
from instrument.geometry import BoolArray, FloatArray, IntArray

_TRIED = 3  # models
_FEWEST, _MOST = 12, 0.2  # points of a table, and fraction of outliers: more are a misfit
# Other points for each parameter: with fewer, the model fits all but a few, whatever they are.
_POINTS_PER_PARAMETER = 4
# Residual of an outlier over the median one: six standard deviations of normal errors, of which
# there is one in 5e8 points.
_STAND_OUT = 9.0
# Relative tolerance and steps of the short robust fits. Of the models whose median residual is no
# more than a few times the least, the simplest is taken.
_QUICK_RTOL, _QUICK_STEPS, _CLOSE = 1e-2, 12, 2.0
_SIGMA_PER_MEDIAN = 1.4826  # of the absolute values of normal errors
_CLEARLY_BETTER = 0.6  # misfit without the points, as a fraction of that of the usual fit
# Neighbours off to one side, from this number on, are a part of the reflectance that is missing in
# the model, or an error that grows. So may be bright points alone near the mirror direction (in
# degrees), and points alone at the ends of sweeps.
_A_STRETCH, _NEAR_MIRROR_DEG = 3, 5.0


class Outliers(NamedTuple):
    """Points (M,), by index, without which `model` explains the data.

    worst: index of the one farthest off, by `deviation`, relative to the model. before, after: rms
    residual over the mean value, of the usual fit, and of the model without these points.
    """

    model: str
    points: IntArray
    worst: int
    deviation: float
    before: float
    after: float

    def text(self, m: Measurements) -> str:
        """The finding, with the worst point of the measurements."""
        k, count = self.worst, self.points.size
        return (
            f"{count} of {m.size} points {'seems an outlier' if count == 1 else 'seem outliers'}: "
            f"{self.model} explains the others, with an rms residual of {100 * self.after:.2g} % "
            f"instead of {100 * self.before:.2g} %; largest: theta_i {m.theta_i_deg[k]:.4g}, "
            f"theta_r {m.theta_r_deg[k]:.4g}, dphi {m.dphi_deg[k]:.4g} degrees "
            f"({100 * self.deviation:+.3g} %). Check them, or give them less weight: gonio fit "
            "--robust (from Python: robust=True)"
        )


def outliers(
    first: Sequence[FirstFit],
    m: Measurements,
    acceptance: Acceptance | None,
    usual: FitResult,
) -> Outliers | None:
    """Outliers of a model that explains the other points, None if there is no such model.

    `first`: the models' first fits. `usual`: the chosen fit, whose misfit is to be explained.
    """
    robust = _with_outliers(first, m)
    if robust is None:
        return None
    out = _stand_out(robust, m)
    others = m.subset(~out)
    few = others.size < _POINTS_PER_PARAMETER * robust.solution.x.size
    if few or _systematic(robust, m, out):
        return None
    fitted = refine(FirstFits(others).of(robust.model), others, acceptance, u="none")
    if not _explains(fitted, others, usual):
        return None
    predicted = robust.problem.predict(robust.solution.x)
    points, size = np.flatnonzero(out), _sizes(robust, m)
    worst = int(points[np.argmax(size[points])])
    return Outliers(
        fitted.model, points, worst, float(m.brdf[worst] / predicted[worst] - 1),
        usual.rms_relative, fitted.rms_relative,
    )  # fmt: skip


def _with_outliers(first: Sequence[FirstFit], m: Measurements) -> FirstFit | None:
    """Short robust fit of the simplest near model of which a few points stand out."""
    if m.size < _FEWEST:
        return None
    nearest = sorted(first, key=lambda f: float(np.median(_sizes(f, m))))[:_TRIED]
    robust = [_robust(f, m) for f in nearest]
    hopeful = [f for f in robust if 0 < np.mean(_stand_out(f, m)) <= _MOST]
    medians = [float(np.median(_sizes(f, m))) for f in hopeful]
    close = [f for f, own in zip(hopeful, medians, strict=True) if own <= _CLOSE * min(medians)]
    return min(close, key=lambda f: f.solution.x.size, default=None)


def _robust(first: FirstFit, m: Measurements) -> FirstFit:
    """A few steps with Huber's loss.

    The median residual gives the noise: a stated u may lack the errors that points share.
    """
    noise = max(_SIGMA_PER_MEDIAN * float(np.median(_sizes(first, m))), np.finfo(float).tiny)
    covariance = first.problem.covariance
    wider = replace(covariance, variance=covariance.variance * noise**2)
    problem = replace(first.problem, covariance=wider, huber=HUBER)
    found = problem.solve(first.solution.x, rtol=_QUICK_RTOL, most_steps=_QUICK_STEPS)
    return replace(first, solution=found)


def _residuals(fit: FirstFit, m: Measurements) -> FloatArray:
    return np.asarray(m.brdf - fit.problem.predict(fit.solution.x))


def _sizes(fit: FirstFit, m: Measurements) -> FloatArray:
    """Sizes (N,) of the residuals in u; in 1/sr where no u is stated."""
    return np.asarray(np.abs(_residuals(fit, m)) / (1.0 if m.u_random is None else m.u_random))


def _stand_out(fit: FirstFit, m: Measurements) -> BoolArray:
    """Mask (N,) of the points far above the median residual.

    Without a stated u: of one in 1/sr, and of one relative to the value; noise may be either.
    """
    sizes = [_sizes(fit, m)]
    if m.u_random is None:
        sizes.append(relative_size(sizes[0], fit.problem.predict(fit.solution.x)))
    with np.errstate(over="ignore"):  # no size is above a limit beyond a double
        far = [size > _STAND_OUT * np.median(size) for size in sizes]
    return np.asarray(np.logical_and.reduce(far))


def _explains(fitted: FitResult, others: Measurements, usual: FitResult) -> bool:
    """True if the model agrees with the other points, and much better than the usual fit."""
    random = runs_probability(others, fitted.residuals) > SIGNIFICANCE
    better = _misfit(fitted) < _CLEARLY_BETTER * _misfit(usual)
    return random and better and agreement(fitted, others).agrees


def _misfit(result: FitResult) -> float:
    """Root mean square of the residuals in u; relative to the mean where no u is stated."""
    return result.rms_relative if result.chi2 is None else math.sqrt(result.reduced_chi2 or 0.0)


def _systematic(fit: FirstFit, m: Measurements, out: BoolArray) -> bool:
    """True where the points that stand out may belong to a lobe, or to an error that grows."""
    sign, ends = np.sign(_residuals(fit, m)) * out, np.zeros(m.size, dtype=bool)
    for _, _, points in sweeps(m):
        ends[points[[0, -1]]] = True
        s = sign[points]
        runs = np.split(s, np.flatnonzero(np.diff(s)) + 1)
        if any(run[0] != 0 and run.size >= _A_STRETCH for run in runs):
            return True
    g = m.geometry
    off = np.hypot(g.theta_i_deg - g.theta_r_deg, g.theta_r_deg * (1 + g.cos_dphi))
    mirror = (sign > 0) & (off < _NEAR_MIRROR_DEG)
    return bool(np.all((mirror | ends)[out]))
