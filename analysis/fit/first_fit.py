"""First fit of a model, with the independent uncertainties alone: finds the deepest minimum.

The search starts from every local minimum of a grid, and from the fits of the special cases of the
model: no fit ends above that of a simpler model which it contains. Nothing here depends on which
other models are compared.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from analysis.data.covariance import independent_covariance
from analysis.data.measurements import Measurements
from analysis.fit.criteria import bic, enough_chi2, variance_floor
from analysis.fit.levenberg_marquardt import HUBER, Minimum
from analysis.fit.problem import Problem
from analysis.fit.relative_scale import FACTOR_NAME, relative_model
from analysis.fit.starting_values import Grid, Known, values_between
from analysis.models import MODELS, Model
from analysis.models.special_cases import special_cases
from instrument.errors import NotDetermined
from instrument.geometry import FloatArray, Geometry

# Local minima of a grid from which the search starts: on real scans there are one to five.
MAX_STARTS = 10
# Relative tolerance of chi2, and the most steps, of the search from every start. A minimum that is
# above the best by no more than such a fraction, or an unfinished one, is searched to the end.
_QUICK_RTOL, _QUICK_STEPS = 1e-3, 30
_CLOSE, _UNFINISHED = 0.1, 1.0
_LEVEL_RTOL = 1e-2
# Steps between the `starts` of a parameter that is scanned, and the relative tolerance there.
_SCAN_STEPS, _SCAN_RTOL = 4, 0.1
# A search from a further start ends with a step that lowers chi2 by this fraction of the best.
_CRAWLING = 0.1
# Starts that lead to the same chi2, but for this fraction of it, after which no other is expected
# to explain the data better; twice as many where they do not explain the data.
_AGREEING, _ALIKE = 2, 2e-3
# Further searches along a valley that one search does not reach the end of; distance of minima that
# count as one, as a fraction of the domain.
_VALLEY, _BESIDE = 5, 1e-3
# chi2, relative to that of a model that explains the data, up to which a valley is crossed.
_NEARLY = 2.0
# Distance to either side of a minimum at which chi2 is looked at, in u, and the factor by which its
# rise there may differ from that of a parabola; least curvature, relative to the largest.
_FAR_U, _BENT, _FLAT = 3.0, 2.0, 1e-12
# Step of a finite difference, relative to the distance from the nearer bound; second derivative of
# chi2, in u^2 per unit^2, that underflows.
_DIFFERENCE, _NO_CURVATURE = 1e-5, 1e-200
# Relative decrease of chi2 from which another point counts as lower.
LOWER = 1e-9
# Iterations in which a robust fit and its estimate of the noise converge.
_ROBUST_ROUNDS = 3
# Standard deviation of normal errors over the median of their absolute values.
_SIGMA_PER_MEDIAN = 1.4826


@dataclass(frozen=True, slots=True)
class FirstFit:
    """Model fitted with the independent uncertainties alone, without averaging.

    model: as it was asked for, without a factor for relative measurements. grid: the model on the
    nodes of the search. starts: parameters (K,) of all minima found, the
    deepest first.
    """

    model: Model
    problem: Problem
    solution: Minimum
    bic: float
    grid: Grid
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
        nodes = grid.minima(problem.covariance, MAX_STARTS)
        enough = enough_chi2(m, problem)
        found = all_minima(problem, nodes, enough)
        for x in self._special_cases(problem) if found[0].chi2 > enough else ():
            if problem.chi2(x) < found[0].chi2 * (1 - LOWER):
                found.insert(0, _to_the_end(problem, x))
        starts = tuple(minimum.x for minimum in found)
        return FirstFit(model, problem, found[0], bic(m, problem, found[0]), grid, starts)

    def _grid(self, model: Model) -> Grid:
        if model.name not in self.grids:
            m = self.measurements
            fitted = relative_model(model, m.brdf) if m.relative else model
            _require_points(fitted, m)
            problem = Problem(fitted, m.geometry, m.brdf, independent_covariance(m))
            self.grids[model.name] = Grid.of(problem, self.known)
        return self.grids[model.name]

    def _special_cases(self, problem: Problem) -> Iterator[FloatArray]:
        """Fits of the special cases of the problem's model, as parameters (K,) of the problem."""
        model = problem.model
        for case in special_cases(model.name):
            first = self.of(MODELS[case.name])
            names = (p.name for p in first.problem.model.parameters)
            values = dict(zip(names, map(float, first.solution.x), strict=True))
            at = case.embed(values, model)
            if FACTOR_NAME in values:  # relative: no scale is 0, but all may be small
                small = {p.name: max(at[p.name], p.low) for p in model.parameters if p.scale}
                at |= small | {FACTOR_NAME: values[FACTOR_NAME]}
            x = np.array([at[p.name] for p in model.parameters])
            if np.all((problem.low <= x) & (x <= problem.high)):
                yield x


def first_fit(model: Model, measurements: Measurements, robust: bool = False) -> FirstFit:
    """Find the deepest minimum with independent uncertainties. Raises `NotDetermined` as `fit`.

    For relative measurements the model has one more parameter: see `analysis.fit.relative_scale`.
    """
    first = FirstFits(measurements).of(model)
    return huber_refit(first, measurements) if robust else first


def all_minima(
    problem: Problem, starts: Sequence[FloatArray], enough: float = 0.0
) -> list[Minimum]:
    """Minima of a problem from all starts, the deepest first; it and any as deep to the end.

    The search ends where several starts have led to the same minimum with a chi2 of `enough`.
    """
    found: list[Minimum] = []
    for start in starts:
        crawling = _CRAWLING * found[0].chi2 if found else 0.0
        one = problem.solve(_levelled(problem, start), (), crawling, _QUICK_RTOL, _QUICK_STEPS)
        found = sorted([*found, one], key=_depth)
        agreeing = sum(one.chi2 <= found[0].chi2 * (1 + _ALIKE) for one in found)
        if found[0].chi2 <= enough and agreeing >= _AGREEING:
            break
    for start in _starts_beside(problem, found[0].x):
        found.append(problem.solve(_levelled(problem, start), (), 0.0, _QUICK_RTOL, _QUICK_STEPS))
    found = sorted(found, key=_depth)
    done = [_to_the_end(problem, found[0].x)]
    for one in found[1:]:
        above = (_CLOSE if one.converged else _UNFINISHED) * found[0].chi2 + enough
        if one.chi2 <= found[0].chi2 + above and not _reached(problem, one, done):
            done.append(_to_the_end(problem, one.x))
    lowest = min(done, key=_depth)
    if lowest.chi2 <= _NEARLY * enough:
        done.append(_across_the_valley(problem, lowest))
    return _distinct(problem, sorted([*done, *found], key=_depth))


def _across_the_valley(problem: Problem, found: Minimum) -> Minimum:
    """The minimum, or a lower one beside it along the direction that the data determine least.

    Along a long valley noise makes several minima. There chi2 does not rise by k^2 at k u, as it
    does where the model is linear: only then is there another search.
    """
    for _ in range(_VALLEY):
        lower = found
        for step in _weakest_direction(problem, found.x):
            x = np.clip(found.x + _FAR_U * step, problem.low, problem.high)
            rise = (problem.chi2(x) - found.chi2) / _FAR_U**2
            if not 1 / _BENT < rise < _BENT:
                lower = min(lower, problem.solve(x), key=_depth)
        if lower.chi2 >= found.chi2 * (1 - LOWER):
            break
        found = lower
    return found


def _weakest_direction(problem: Problem, x: FloatArray) -> list[FloatArray]:
    """Steps of one u from x (K,), to either side, along the least determined combination.

    Of the parameters in units of what each changes alone; none where it changes nothing.
    """
    J = problem.jacobian(x)
    size = np.linalg.norm(J, axis=0)
    moving = (size > 0) & (x > problem.low) & (x < problem.high)
    if not np.any(moving):
        return []
    J = J[:, moving] / size[moving]
    values, vectors = np.linalg.eigh(J.T @ J)
    step = np.zeros_like(x)
    step[moving] = vectors[:, 0] / np.sqrt(max(values[0], _FLAT)) / size[moving]
    return [step, -step]


def _starts_beside(problem: Problem, x: FloatArray) -> Iterator[FloatArray]:
    """Starts near other minima along the axes of the parameters that are scanned for them."""
    for i, parameter in enumerate(problem.model.parameters):
        if parameter.scanned:
            values = np.array(values_between(parameter, _SCAN_STEPS))
            at = np.searchsorted(values, x[i])
            up = list(_profile(problem, x, i, values[at:]))
            down = list(_profile(problem, x, i, values[:at][::-1]))
            line = [*down[::-1], Minimum(x, problem.chi2(x), True, ""), *up]
            chi2 = np.array([np.inf, *(one.chi2 for one in line), np.inf])
            low = (chi2[1:-1] < chi2[:-2]) & (chi2[1:-1] < chi2[2:])
            low[len(down)] = False
            yield from (one.x for one, lower in zip(line, low, strict=True) if lower)


def _profile(problem: Problem, x: FloatArray, index: int, values: FloatArray) -> Iterator[Minimum]:
    """Rough minima over the other parameters at the values of one, each from the one before it."""
    for value in values:
        x = x.copy()
        x[index] = value
        found = problem.solve(x, (index,), rtol=_SCAN_RTOL)
        yield found
        x = found.x


def _levelled(problem: Problem, x: FloatArray) -> FloatArray:
    """Start x (K,) with the level adjusted to the data, and the scales with it, shapes held."""
    parameters = problem.model.parameters
    if not any(p.level for p in parameters):
        return x
    shapes = [i for i, p in enumerate(parameters) if not (p.scale or p.level)]
    return problem.solve(x, shapes, rtol=_LEVEL_RTOL).x


def _to_the_end(problem: Problem, x: FloatArray) -> Minimum:
    """Minimum from x (K,), by Newton's steps where those of Gauss and Newton crawl.

    These leave out the second derivatives of the model, which count where the residuals are large.
    """
    found = problem.solve(x, most_steps=_QUICK_STEPS)
    for _ in range(_VALLEY):
        if found.converged:
            break
        found = problem.solve(_newton_step(problem, found))
    return found


def _newton_step(problem: Problem, found: Minimum) -> FloatArray:
    """Parameters (K,) after a step with all second derivatives, or those of `found` if higher."""
    x = found.x
    inside = (x > problem.low) & (x < problem.high)
    free = np.flatnonzero(inside & problem.jacobian(x).any(axis=0))

    def gradient(x: FloatArray) -> FloatArray:
        return problem.jacobian(x, free.tolist()).T @ problem.residual(x)

    here, H = gradient(x), np.empty((free.size, free.size))
    for k, i in enumerate(free):
        moved = x.copy()
        moved[i] += _DIFFERENCE * min(x[i] - problem.low[i], problem.high[i] - x[i])
        H[k] = (gradient(moved) - here) / (moved[i] - x[i])
    size = np.sqrt(np.maximum(np.abs(np.diag(H)), _NO_CURVATURE))
    values, vectors = np.linalg.eigh((H + H.T) / 2 / np.outer(size, size))
    if free.size == 0 or values[0] <= _FLAT:
        return x
    new = x.copy()
    new[free] -= vectors @ ((vectors.T @ (here / size)) / values) / size
    new = np.clip(new, problem.low, problem.high)
    return new if problem.chi2(new) < found.chi2 else x


def deepest(problem: Problem, x: FloatArray, others: Iterable[FloatArray]) -> Minimum:
    """Minimum from x (K,), or from any of the others that lies lower."""
    found = _to_the_end(problem, x)
    for other in others:
        if problem.chi2(other) < found.chi2 * (1 - LOWER):
            found = min(found, _to_the_end(problem, other), key=_depth)
    return found


def _depth(minimum: Minimum) -> float:
    return minimum.chi2


def _distinct(problem: Problem, found: Iterable[Minimum]) -> list[Minimum]:
    """Minima, lowest first, without those beside one before them."""
    kept: list[Minimum] = []
    for one in found:
        if not _reached(problem, one, kept):
            kept.append(one)
    return kept


def _reached(problem: Problem, one: Minimum, others: Iterable[Minimum]) -> bool:
    """True if one of the others is no higher and lies within a small part of the domain of it."""
    near = _BESIDE * (problem.high - problem.low)
    return any(
        other.chi2 <= one.chi2 and bool(np.all(np.abs(one.x - other.x) <= near)) for other in others
    )


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
