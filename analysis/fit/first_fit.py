"""First fit of a model, with the independent uncertainties alone: finds the deepest minimum."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from analysis.data.covariance import independent_covariance
from analysis.data.measurements import Measurements
from analysis.fit.criteria import bic, explained, variance_floor
from analysis.fit.levenberg_marquardt import HUBER, Minimum
from analysis.fit.problem import Problem
from analysis.fit.relative_scale import FACTOR_NAME, relative_model
from analysis.fit.starting_values import starting_values
from analysis.models import Model
from instrument.errors import NotDetermined
from instrument.geometry import FloatArray, Geometry

# Starting values, the best included, that are tried where the best does not explain the data.
_MAX_STARTS = 3
_QUICK_RTOL = 1e-4
# Iterations in which a robust fit and its estimate of the noise converge.
_ROBUST_ROUNDS = 3
# Standard deviation of normal errors over the median of their absolute values.
_SIGMA_PER_MEDIAN = 1.4826


@dataclass(frozen=True, slots=True)
class FirstFit:
    """Model fitted with the independent uncertainties alone, without averaging.

    untried: starting values, (K,) each, near other local minima.
    """

    problem: Problem
    solution: Minimum
    bic: float
    untried: tuple[FloatArray, ...] = ()

    def brdf(self, geometry: Geometry) -> FloatArray:
        """BRDF of the fitted model in 1/sr, of the shape of the geometry."""
        return self.problem.model_brdf(self.solution.x, geometry)


def first_fit(model: Model, measurements: Measurements, robust: bool = False) -> FirstFit:
    """Find the deepest minimum with independent uncertainties. Raises `NotDetermined` as `fit`."""
    return multi_start(quick_fit(model, measurements), measurements, robust)


def quick_fit(model: Model, measurements: Measurements) -> FirstFit:
    """Fit roughly, from the best starting value alone. Raises `NotDetermined` as `fit` does.

    For relative measurements the model has one more parameter: see `analysis.fit.relative_scale`.
    """
    if measurements.relative:
        model = relative_model(model, measurements.brdf)
    _require_points(model, measurements)
    covariance = independent_covariance(measurements)
    problem = Problem(model, measurements.geometry, measurements.brdf, covariance)
    first, *others = starting_values(problem, _MAX_STARTS)
    solution = problem.solve(first, rtol=_QUICK_RTOL)
    return FirstFit(problem, solution, bic(measurements, problem, solution), tuple(others))


def multi_start(quick: FirstFit, m: Measurements, robust: bool = False) -> FirstFit:
    """Complete a quick fit; unless it explains the data, keep the deepest minimum of all starts."""
    problem, best = quick.problem, quick.solution
    if problem.huber is not None:
        return quick  # complete already
    best = problem.solve(best.x)
    for start in quick.untried:
        if explained(problem, best, m):
            break
        best = min(best, problem.solve(start), key=lambda found: (not found.converged, found.chi2))
    if robust:
        problem, best = _huber_refit(problem, best, m)
    return FirstFit(problem, best, bic(m, problem, best))


def _huber_refit(problem: Problem, solution: Minimum, m: Measurements) -> tuple[Problem, Minimum]:
    """Refit with Huber's loss; without stated u the median residual estimates the noise."""
    problem = replace(problem, huber=HUBER)
    for _ in range(_ROBUST_ROUNDS if m.u_random is None else 1):
        if m.u_random is None:
            size = np.abs(problem.predict(solution.x) - problem.brdf)
            sigma = _SIGMA_PER_MEDIAN * float(np.median(size))
            variance = np.full(m.size, max(sigma**2, variance_floor(problem)))
            problem = replace(problem, covariance=replace(problem.covariance, variance=variance))
        solution = problem.solve(solution.x)
    return problem, solution


def enough_points(model: Model, measurements: Measurements) -> bool:
    """True for as many points as parameters, or more; without stated u one more is needed."""
    return measurements.size >= _points_needed(model, measurements)


def _points_needed(model: Model, m: Measurements) -> int:
    counted = any(p.name == FACTOR_NAME for p in model.parameters)
    return len(model.parameters) + (m.u_random is None) + (m.relative and not counted)


def _require_points(model: Model, measurements: Measurements) -> None:
    if not enough_points(model, measurements):
        raise NotDetermined(
            f"{model.name} has {len(model.parameters)} parameters; {measurements.size} points do "
            f"not determine them; allowed: {_points_needed(model, measurements)} points or more"
            + (" where no u_brdf is stated" if measurements.u_random is None else "")
        )
