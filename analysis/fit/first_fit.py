"""First fit of a model, with the independent uncertainties alone: finds the deepest minimum.

The search starts from every local minimum of a grid, and from the fits of the special cases of the
model: no fit ends above that of a simpler model which it contains. Of very many points a part shows
where the minima are, and each is then followed with all of them. Nothing here depends on which
other models are compared.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from analysis.data.covariance import independent_covariance
from analysis.data.measurements import Measurements
from analysis.data.thinning import thinned
from analysis.fit.criteria import bic, enough_chi2, variance_floor
from analysis.fit.relative_scale import FACTOR_NAME, relative_model
from analysis.fit.search.levenberg_marquardt import HUBER, Minimum
from analysis.fit.search.minima import LOWER, all_minima, followed
from analysis.fit.search.problem import Problem
from analysis.fit.search.starting_values import MANY, Grid, Known
from analysis.models import Model
from analysis.models.special_cases import special_cases
from instrument.errors import NotDetermined
from instrument.geometry import FloatArray, Geometry

# Local minima of a grid from which the search starts, and of one for MANY points.
_MAX_STARTS, _STARTS_OF_MANY = 10, 5
# Points from which on a part of them, so many, shows where the minima are.
_VERY_MANY, _PART = 4000, 1000
# Minima of the part whose chi2 there is above the lowest by no more than this fraction may be the
# deepest of all points; so many of them are looked at.
_NEAR, _LOOKED_AT = 0.1, 3
# A minimum of the part lies off that of all points by its own u: there chi2 is above the minimum by
# about K / _PART of it. Those that are above the lowest by no more than this fraction are followed.
_CLOSE = 0.02
# They are followed until a step lowers chi2 by no more than this, in units of u^2: the step before
# it ended within 0.1 u.
_RISE = 0.01
# chi2 of all points over that of the part, for each point, up to which the part stands for them;
# relative tolerance and most steps with which a rough fit is followed otherwise.
_AS_EXPECTED, _ROUGH_RTOL, _ROUGH_STEPS = 1.5, 1e-2, 4
LEFT = f"fitted to {_PART} of the points only, on which it is far behind"
"""Message of a rough fit."""
# Iterations in which a robust fit and its estimate of the noise converge.
_ROBUST_ROUNDS = 3
# Standard deviation of normal errors over the median of their absolute values.
_SIGMA_PER_MEDIAN = 1.4826


@dataclass(frozen=True, slots=True)
class FirstFit:
    """Model fitted with the independent uncertainties alone, without averaging.

    model: as it was asked for, without a factor for relative measurements. starts: parameters (K,)
    of all minima found, the deepest first. rough: its search was not followed to the end.
    """

    model: Model
    problem: Problem
    solution: Minimum
    bic: float
    starts: tuple[FloatArray, ...] = ()
    rough: bool = False

    def brdf(self, geometry: Geometry) -> FloatArray:
        """BRDF of the fitted model in 1/sr, of the shape of the geometry."""
        return self.problem.model_brdf(self.solution.x, geometry)


@dataclass(frozen=True, slots=True)
class FirstFits:
    """First fits to one set of measurements, each made once: models share their special cases.

    made, rough, grids: by name of the model. known: parts of the terms that the grids share. part:
    first fits to a part of very many measurements, else None.
    """

    measurements: Measurements
    made: dict[str, FirstFit] = field(default_factory=dict)
    rough: dict[str, FirstFit] = field(default_factory=dict)
    grids: dict[str, Grid] = field(default_factory=dict)
    known: Known = field(default_factory=dict)
    part: FirstFits | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        m = self.measurements
        if m.size > _VERY_MANY:
            object.__setattr__(self, "part", FirstFits(thinned(m, _PART)))

    def of(self, model: Model) -> FirstFit:
        """First fit of a model. Raises `NotDetermined` as `fit` does."""
        if model.name not in self.made:
            self.made[model.name] = self._fit(model)
        return self.made[model.name]

    def roughly(self, model: Model) -> FirstFit:
        """Fit to the part of very many measurements, with the chi2 that it has of all of them.

        That is above its least value by about K / _PART. Where it is much larger, as the part has
        too few points where it counts, a few steps follow.
        """
        if self.part is None or model.name in self.made:
            return self.of(model)
        if model.name not in self.rough:
            self.rough[model.name] = self._fit_roughly(model, self.part.of(model))
        return self.rough[model.name]

    def _fit_roughly(self, model: Model, in_part: FirstFit) -> FirstFit:
        problem = self._problem(model)
        ((chi2, start), *_) = _lowest(problem, in_part)
        found = Minimum(start, chi2, False, LEFT)
        if found.chi2 > _highest_expected(problem, in_part):
            steps = problem.solve(start, rtol=_ROUGH_RTOL, most_steps=_ROUGH_STEPS)
            found = steps._replace(converged=False, message=LEFT)
        own = bic(self.measurements, problem, found)
        return FirstFit(model, problem, found, own, (found.x,), rough=True)

    def polished(self, first: FirstFit) -> FirstFit:
        """The fit with its minimum followed to the end."""
        if self.part is None:
            return first
        own = self.of(first.model)
        found = own.problem.solve(own.solution.x)
        return replace(own, solution=found, bic=bic(self.measurements, own.problem, found))

    def _fit(self, model: Model) -> FirstFit:
        m, problem = self.measurements, self._problem(model)
        enough = enough_chi2(m, problem)
        found = self._minima(model, problem, enough)
        clear = found[0].chi2 <= enough and m.size >= MANY
        for x in () if clear else self._special_cases(model, problem):
            if problem.chi2(x) < found[0].chi2 * (1 - LOWER):
                found.insert(0, problem.solve(x))
        starts = tuple(minimum.x for minimum in found)
        return FirstFit(model, problem, found[0], bic(m, problem, found[0]), starts)

    def _problem(self, model: Model) -> Problem:
        m = self.measurements
        fitted = relative_model(model, m.brdf) if m.relative else model
        _require_points(fitted, m)
        return Problem(fitted, m.geometry, m.brdf, independent_covariance(m))

    def _minima(self, model: Model, problem: Problem, enough: float) -> list[Minimum]:
        """Minima of a problem, the deepest first."""
        if self.part is not None:
            starts = _lowest(problem, self.part.of(model))
            atol = _RISE * starts[0][0] / self.measurements.size
            return followed(problem, starts, atol)
        if model.name not in self.grids:
            self.grids[model.name] = Grid.of(problem, self.known)
        count = _MAX_STARTS if self.measurements.size < MANY else _STARTS_OF_MANY
        nodes = self.grids[model.name].minima(problem.covariance, count)
        return all_minima(problem, nodes, enough)

    def _special_cases(self, model: Model, problem: Problem) -> Iterator[FloatArray]:
        """Fits of the special cases of a model, as parameters (K,) of the problem."""
        for case in special_cases(model):
            if self.part is not None and not _near(self.part.of(case.model), self.part.of(model)):
                continue
            first = self.roughly(case.model)
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


def _near(one: FirstFit, other: FirstFit) -> bool:
    """True if the chi2 of one fit is above that of another by a small part, or below it."""
    return one.solution.chi2 <= (1 + _NEAR) * other.solution.chi2


def _lowest(problem: Problem, in_part: FirstFit) -> list[tuple[float, FloatArray]]:
    """Minima of the fit to a part with about the lowest chi2 of all points: chi2 and x (K,).

    All are looked at where the part has no point in a lobe that is narrow there, and wrong.
    """
    most = (1 + _NEAR) * in_part.solution.chi2
    starts = [x for x in in_part.starts[:_LOOKED_AT] if in_part.problem.chi2(x) <= most]
    found = sorted(((problem.chi2(x), k) for k, x in enumerate(starts)))
    if found[0][0] > _highest_expected(problem, in_part):
        starts = list(in_part.starts)
        found = sorted((problem.chi2(x), k) for k, x in enumerate(starts))
    return [(chi2, starts[k]) for chi2, k in found if chi2 <= (1 + _CLOSE) * found[0][0]]


def _highest_expected(problem: Problem, in_part: FirstFit) -> float:
    """chi2 of all points up to which the part stands for them."""
    return _AS_EXPECTED * in_part.solution.chi2 * problem.brdf.size / in_part.problem.brdf.size


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
