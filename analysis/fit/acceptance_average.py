"""Fit of a model averaged as the rig averages it, without averaging at every search step.

Over the rig's acceptance, and over the angle by which theta_r turned while a value was taken.
The averaged model is written as gain * model + offset, both computed at the parameters of the last
round. The search runs with them fixed, then they are computed anew, until they no longer change.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.data.acceptance import Acceptance, averaged_brdf, required_rings
from analysis.data.measurements import Measurements
from analysis.fit.criteria import reduced_chi2
from analysis.fit.search.levenberg_marquardt import Minimum
from analysis.fit.search.minima import deepest
from analysis.fit.search.problem import Problem
from instrument.geometry import FloatArray, Geometry, IntArray

MAX_ROUNDS = 12

# All in units of the points' independent uncertainty: the least effect of averaging that counts,
# the change at which the rounds have converged, and the tolerance of the quadrature, whose
# errors have like sign along a lobe: together they shift its width by a larger part of its u.
RELEVANT, CONVERGED, _QUADRATURE = 1 / 3, 0.05, 0.02

# Outside these ratios a gain would magnify errors of a nearly vanishing model: then an offset.
_MIN_GAIN, _MAX_GAIN = 0.1, 5.0

# Gauss and Legendre's rule of three points for a mean over -1/2 to 1/2, exact up to the fifth power
# (Abramowitz and Stegun 1964, table 25.4).
_TURN = ((-math.sqrt(0.15), 5 / 18), (0.0, 8 / 18), (math.sqrt(0.15), 5 / 18))


@dataclass(frozen=True, slots=True)
class AveragedFit:
    """A solution and its problem; flags: the model was averaged, and the rounds converged."""

    problem: Problem
    solution: Minimum
    averaged: bool
    converged: bool


def fit_averaged(
    problem: Problem,
    solution: Minimum,
    measurements: Measurements,
    acceptance: Acceptance | None,
    u: FloatArray,
    starts: Sequence[FloatArray] = (),
) -> AveragedFit:
    """Refit with the model averaged as the rig does, where that changes it by more than u/3.

    `solution` is the fit without averaging, `u` (N,) the independent uncertainty in 1/sr; it counts
    as larger where the model does not explain the data. `starts`, (K,) each, are other minima of
    the fit without averaging: the averaged model may fit best near one of them.
    """

    def misfit() -> FloatArray:
        if measurements.u_random is None:
            return u
        return u * math.sqrt(max(1.0, reduced_chi2(problem, solution)))

    rings = _rings(problem, solution.x, measurements, acceptance, misfit())
    mean = _mean(problem, solution.x, measurements, acceptance, rings)
    if np.all(np.abs(mean - problem.model_brdf(solution.x)) <= RELEVANT * misfit()):
        return AveragedFit(problem, solution, averaged=False, converged=True)
    converged = False
    for _ in range(MAX_ROUNDS):
        problem = _corrected(problem, solution.x, mean)
        solution = deepest(problem, solution.x, starts)
        rings = np.maximum(rings, _rings(problem, solution.x, measurements, acceptance, misfit()))
        mean = _mean(problem, solution.x, measurements, acceptance, rings)
        converged = bool(np.all(np.abs(mean - problem.predict(solution.x)) < CONVERGED * misfit()))
        if converged:
            break
    return AveragedFit(problem, solution, averaged=True, converged=converged)


def _corrected(problem: Problem, x: FloatArray, mean: FloatArray) -> Problem:
    """The problem with gain and offset that turn the model at x into its mean (N,)."""
    model = problem.model_brdf(x)
    moderate = (mean * model > 0) & (np.abs(mean) < _MAX_GAIN * np.abs(model))
    moderate &= np.abs(mean) > _MIN_GAIN * np.abs(model)
    gain = np.divide(mean, model, out=np.ones_like(mean), where=moderate)
    return replace(problem, gain=gain, offset=np.where(moderate, 0.0, mean - model))


def _rings(
    problem: Problem, x: FloatArray, m: Measurements, acceptance: Acceptance | None, u: FloatArray
) -> IntArray:
    """Rings (N,) that the average over each point's acceptance needs."""
    if acceptance is None:
        return np.zeros(m.size, dtype=np.int64)
    size = np.maximum(np.abs(problem.model_brdf(x)), u)
    return required_rings(
        lambda geometry: problem.model_brdf(x, geometry),
        m.theta_i_deg,
        m.theta_r_deg,
        m.dphi_deg,
        acceptance,
        tolerance=_QUADRATURE * u / size,
    )


def _mean(
    problem: Problem, x: FloatArray, m: Measurements, acceptance: Acceptance | None, rings: IntArray
) -> FloatArray:
    """The averaged model (N,), each point with its own number of rings."""
    if not np.any(m.blur_deg):
        return _over_acceptance(problem, x, m, m.theta_r_deg, acceptance, rings)
    views = ((m.theta_r_deg + part * m.blur_deg, weight) for part, weight in _TURN)
    means = (
        weight * _over_acceptance(problem, x, m, view, acceptance, rings) for view, weight in views
    )
    return np.asarray(sum(means))


def _over_acceptance(
    problem: Problem,
    x: FloatArray,
    m: Measurements,
    theta_r_deg: FloatArray,
    acceptance: Acceptance | None,
    rings: IntArray,
) -> FloatArray:
    """The model (N,) averaged over the acceptance, if any, at views (N,) of their own."""

    def brdf(geometry: Geometry) -> FloatArray:
        return problem.model_brdf(x, geometry)

    theta_i_deg, dphi_deg = m.theta_i_deg, m.dphi_deg
    if acceptance is None:
        return brdf(Geometry.from_degrees(theta_i=theta_i_deg, theta_r=theta_r_deg, dphi=dphi_deg))
    mean = np.empty(m.size)
    for n in np.unique(rings):
        k = rings == n
        mean[k] = averaged_brdf(
            brdf, theta_i_deg[k], theta_r_deg[k], dphi_deg[k], acceptance, int(n)
        )
    return mean


def is_averaged(m: Measurements, acceptance: Acceptance | None) -> bool:
    """True if the values are means, over the rig's acceptance or over a turn of theta_r."""
    return acceptance is not None or bool(np.any(m.blur_deg))
