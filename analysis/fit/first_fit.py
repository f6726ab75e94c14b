"""A first fit: the basin of the minimum, with the independent uncertainties alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from analysis.data.covariance import independent
from analysis.data.measurements import Measurements
from analysis.fit.criteria import bic, explained, floor
from analysis.fit.levenberg_marquardt import HUBER, Minimum
from analysis.fit.problem import Problem
from analysis.fit.relative_scale import NAME as RELATIVE_FACTOR
from analysis.fit.relative_scale import relative
from analysis.fit.starting_values import starts
from analysis.models import Model
from instrument.errors import NotDetermined
from instrument.geometry import FloatArray, Geometry

# Starts that are tried where the first one's minimum does not explain the data.
_MOST_STARTS = 3
# A quick fit ends with a step that lowers chi2 by this part of it.
_NEAR = 1e-4
# Rounds in which a robust fit and its estimate of the noise settle.
_ROBUST_ROUNDS = 3
# Of normal errors, standard deviation over median of the absolute value.
_PER_MEDIAN = 1.4826


@dataclass(frozen=True, slots=True)
class FirstFit:
    """A model fitted with the independent uncertainties alone, without averaging.

    untried: starts in other basins.
    """

    problem: Problem
    solution: Minimum
    bic: float
    untried: tuple[FloatArray, ...] = ()

    def brdf(self, geometry: Geometry) -> FloatArray:
        """The fitted model in any geometry, in 1/sr."""
        return self.problem.plain(self.solution.x, geometry)


def first_fit(model: Model, measurements: Measurements, robust: bool = False) -> FirstFit:
    """The deepest minimum with independent uncertainties. Raises `NotDetermined` as `fit` does."""
    return multi_start(quick_fit(model, measurements), measurements, robust)


def quick_fit(model: Model, measurements: Measurements) -> FirstFit:
    """About the minimum from the best start alone. Raises `NotDetermined` as `fit` does.

    Where measurements are relative, the model has one more parameter: see
    `analysis.fit.relative_scale`.
    """
    if measurements.relative:
        model = relative(model, measurements.brdf)
    _require_points(model, measurements)
    problem = Problem(model, measurements.geometry, measurements.brdf, independent(measurements))
    first, *others = starts(problem, _MOST_STARTS)
    solution = problem.solve(first, settled=_NEAR)
    return FirstFit(problem, solution, bic(measurements, problem, solution), tuple(others))


def multi_start(quick: FirstFit, m: Measurements, robust: bool = False) -> FirstFit:
    """The fit where it explains the data; else the deepest of all basins that have a start."""
    problem, best = quick.problem, quick.solution
    if problem.huber is not None:
        return quick  # it has been through this
    best = problem.solve(best.x)
    for start in quick.untried:
        if explained(problem, best, m):
            break
        best = min(best, problem.solve(start), key=lambda found: (not found.converged, found.chi2))
    if robust:
        problem, best = _huber_refit(problem, best, m)
    return FirstFit(problem, best, bic(m, problem, best))


def _huber_refit(problem: Problem, solution: Minimum, m: Measurements) -> tuple[Problem, Minimum]:
    """The fit with Huber's loss; where no u is stated, the residuals' median gives the noise."""
    problem = replace(problem, huber=HUBER)
    for _ in range(_ROBUST_ROUNDS if m.u_random is None else 1):
        if m.u_random is None:
            left = np.abs(problem.predict(solution.x) - problem.brdf)
            variance = max((_PER_MEDIAN * float(np.median(left))) ** 2, floor(problem))
            problem = replace(
                problem, covariance=replace(problem.covariance, variance=np.full(m.size, variance))
            )
        solution = problem.solve(solution.x)
    return problem, solution


def determined(model: Model, measurements: Measurements) -> bool:
    """Whether there are as many points as parameters (one more where no u is stated)."""
    return measurements.size >= _points_needed(model, measurements)


def _points_needed(model: Model, m: Measurements) -> int:
    named = any(p.name == RELATIVE_FACTOR for p in model.parameters)
    return len(model.parameters) + (m.u_random is None) + (m.relative and not named)


def _require_points(model: Model, measurements: Measurements) -> None:
    if not determined(model, measurements):
        raise NotDetermined(
            f"{model.name} has {len(model.parameters)} parameters; {measurements.size} points do "
            f"not determine them; allowed: {_points_needed(model, measurements)} points or more"
            + (" where no u_brdf is stated" if measurements.u_random is None else "")
        )
