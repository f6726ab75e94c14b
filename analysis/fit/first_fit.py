"""First fit of a model, with the independent uncertainties alone: finds the deepest minimum.

The search starts from every local minimum of a grid, and from the fits of the special cases of the
model: no fit ends above that of a simpler model which it contains. Nothing here depends on which
other models are compared.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from analysis.data.covariance import independent_covariance
from analysis.data.measurements import Measurements
from analysis.fit.criteria import bic, enough_chi2, variance_floor
from analysis.fit.relative_scale import FACTOR_NAME, relative_model
from analysis.fit.search.levenberg_marquardt import HUBER, Minimum
from analysis.fit.search.minima import LOWER, all_minima
from analysis.fit.search.problem import Problem
from analysis.fit.search.starting_values import MANY, Grid, Known
from analysis.models import Model
from analysis.models.special_cases import special_cases
from instrument.errors import NotDetermined
from instrument.geometry import FloatArray, Geometry

# Local minima of a grid from which the search starts, and of one for MANY points.
_MAX_STARTS, _STARTS_OF_MANY = 10, 5
# Iterations in which a robust fit and its estimate of the noise converge.
_ROBUST_ROUNDS = 3
# Standard deviation of normal errors over the median of their absolute values.
_SIGMA_PER_MEDIAN = 1.4826


@dataclass(frozen=True, slots=True)
class FirstFit:
    """Model fitted with the independent uncertainties alone, without averaging.

    model: as it was asked for, without a factor for relative measurements. starts: parameters (K,)
    of all minima found, the deepest first.
    """

    model: Model
    problem: Problem
    solution: Minimum
    bic: float
    starts: tuple[FloatArray, ...] = ()

    def brdf(self, geometry: Geometry) -> FloatArray:
        """BRDF of the fitted model in 1/sr, of the shape of the geometry."""
        return self.problem.model_brdf(self.solution.x, geometry)


@dataclass(frozen=True, slots=True)
class FirstFits:
    """First fits to one set of measurements, each made once: models share their special cases.

    made, grids: by name of the model. known: parts of the terms that the grids share.
    """

    measurements: Measurements
    made: dict[str, FirstFit] = field(default_factory=dict)
    grids: dict[str, Grid] = field(default_factory=dict)
    known: Known = field(default_factory=dict)

    def of(self, model: Model) -> FirstFit:
        """First fit of a model. Raises `NotDetermined` as `fit` does."""
        if model.name not in self.made:
            self.made[model.name] = self._fit(model)
        return self.made[model.name]

    def _fit(self, model: Model) -> FirstFit:
        m, grid = self.measurements, self._grid(model)
        problem = grid.problem
        count = _MAX_STARTS if m.size < MANY else _STARTS_OF_MANY
        nodes = grid.minima(problem.covariance, count)
        enough = enough_chi2(m, problem)
        found = all_minima(problem, nodes, enough)
        clear = found[0].chi2 <= enough and m.size >= MANY
        for x in () if clear else self._special_cases(model, problem):
            if problem.chi2(x) < found[0].chi2 * (1 - LOWER):
                found.insert(0, problem.solve(x))
        starts = tuple(minimum.x for minimum in found)
        return FirstFit(model, problem, found[0], bic(m, problem, found[0]), starts)

    def _grid(self, model: Model) -> Grid:
        if model.name not in self.grids:
            m = self.measurements
            fitted = relative_model(model, m.brdf) if m.relative else model
            _require_points(fitted, m)
            problem = Problem(fitted, m.geometry, m.brdf, independent_covariance(m))
            self.grids[model.name] = Grid.of(problem, self.known)
        return self.grids[model.name]

    def _special_cases(self, model: Model, problem: Problem) -> Iterator[FloatArray]:
        """Fits of the special cases of a model, as parameters (K,) of the problem."""
        for case in special_cases(model):
            first = self.of(case.model)
            names = (p.name for p in first.problem.model.parameters)
            values = dict(zip(names, map(float, first.solution.x), strict=True))
            own = problem.model.parameters
            at = case.embed(values, problem.model)
            if FACTOR_NAME in values:  # relative: no scale is 0, but all may be small
                small = {p.name: max(at[p.name], p.low) for p in own if p.scale}
                at |= small | {FACTOR_NAME: values[FACTOR_NAME]}
            x = np.array([at[p.name] for p in own])
            if np.all((problem.low <= x) & (x <= problem.high)):
                yield x


def first_fit(model: Model, measurements: Measurements, robust: bool = False) -> FirstFit:
    """Find the deepest minimum with independent uncertainties. Raises `NotDetermined` as `fit`.

    For relative measurements the model has one more parameter: see `analysis.fit.relative_scale`.
    """
    first = FirstFits(measurements).of(model)
    return huber_refit(first, measurements) if robust else first


def huber_refit(first: FirstFit, m: Measurements) -> FirstFit:
    """Refit with Huber's loss; without stated u the median residual estimates the noise."""
    problem, solution = replace(first.problem, huber=HUBER), first.solution
    for _ in range(_ROBUST_ROUNDS if m.u_random is None else 1):
        if m.u_random is None:
            size = np.abs(problem.predict(solution.x) - problem.brdf)
            sigma = _SIGMA_PER_MEDIAN * float(np.median(size))
            variance = np.full(m.size, max(sigma**2, variance_floor(problem)))
            problem = replace(problem, covariance=replace(problem.covariance, variance=variance))
        solution = problem.solve(solution.x)
    return replace(first, problem=problem, solution=solution, bic=bic(m, problem, solution))


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
