"""Local minima of chi2 from several starts: of one problem, and the deepest of them.

Every start is first followed roughly; ends that may be the deepest are searched to the end, and
beside them: along a parameter with several minima, and across a valley that the data hardly
determine.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from analysis.fit.search.levenberg_marquardt import MAX_STEPS, Minimum
from analysis.fit.search.problem import Problem
from analysis.fit.search.starting_values import MANY, values_between
from instrument.geometry import FloatArray

# Relative tolerance of chi2, and the most steps, of the search from every start. A minimum that is
# above the best by no more than such a fraction, or an unfinished one, is searched to the end.
_QUICK_RTOL, _QUICK_STEPS = 1e-3, 30
_CLOSE, _UNFINISHED = 0.1, 1.0
# A search from a further start ends with a step that lowers chi2 by this fraction of the best.
_CRAWLING = 0.1
# Starts that lead to the same chi2, but for this fraction of it, after which no other is expected
# to explain the data better.
_AGREEING, _ALIKE = 2, 2e-3
# Relative tolerance with which the level alone is adjusted.
_LEVEL_RTOL = 0.1
# Steps between the `starts` of a parameter that is scanned, and the relative tolerance there.
_SCAN_STEPS, _SCAN_RTOL = 4, 0.1
# Further searches along a valley that one search does not reach the end of; distance of minima that
# count as one, as a fraction of the domain.
_VALLEY, _BESIDE = 5, 1e-3
# chi2, relative to that of a model that explains the data, up to which a valley is crossed.
_NEARLY = 2.0
# Distance to either side of a minimum at which chi2 is looked at, in u, and the factor by which its
# rise there may differ from that of a parabola; least curvature, relative to the largest.
_FAR_U, _BENT, _FLAT = 3.0, 2.0, 1e-12
# Steps after which a start close to a minimum is seen to lead to one found before, and the distance
# from that, as a fraction of the domain.
_FEW_STEPS, _NEARBY = 3, 0.01
# Relative decrease of chi2 from which another point counts as lower.
LOWER = 1e-9


def all_minima(
    problem: Problem, starts: Sequence[FloatArray], enough: float = 0.0
) -> list[Minimum]:
    """Minima of a problem from all starts, the deepest first; it and any as deep to the end.

    Starts are parameters (K,) in the model's units, `enough` is in units of u^2. The search ends
    where several starts have led to the same minimum with a chi2 of `enough`. MANY points that are
    not explained get the search beside the minimum too, unless a level, which must follow each
    step, makes it costly.
    """
    found = _rough_minima(problem, starts, enough)
    if problem.brdf.size < MANY or (found[0].chi2 > enough and not _has_level(problem)):
        beside = [_rough_minimum(problem, start) for start in _starts_beside(problem, found[0].x)]
        found = sorted([*found, *beside], key=_depth)
    done = [problem.solve(found[0].x)]
    for one in found[1:]:
        above = (_CLOSE if one.converged else _UNFINISHED) * found[0].chi2 + enough
        if one.chi2 <= found[0].chi2 + above and not _reached(problem, one, done):
            done.append(problem.solve(one.x))
    lowest = min(done, key=_depth)
    if lowest.chi2 <= _NEARLY * enough:
        done.append(_across_the_valley(problem, lowest))
    return _distinct(problem, sorted([*done, *found], key=_depth))


def _rough_minima(problem: Problem, starts: Sequence[FloatArray], enough: float) -> list[Minimum]:
    found: list[Minimum] = []
    for start in starts:
        crawling = _CRAWLING * found[0].chi2 if found else 0.0
        found = sorted([*found, _rough_minimum(problem, start, crawling)], key=_depth)
        agreeing = sum(one.chi2 <= found[0].chi2 * (1 + _ALIKE) for one in found)
        if found[0].chi2 <= enough and agreeing >= _AGREEING:
            break
    return found


def _rough_minimum(problem: Problem, start: FloatArray, atol: float = 0.0) -> Minimum:
    x = _levelled(problem, start)
    return problem.solve(x, atol=atol, rtol=_QUICK_RTOL, most_steps=_QUICK_STEPS)


def followed(
    problem: Problem, starts: Iterable[tuple[float, FloatArray]], atol: float
) -> list[Minimum]:
    """Minima from starts close to them, the deepest first; `atol` is in units of u^2.

    starts: chi2, in units of u^2, and x (K,), in the model's units, the lowest first. One beside
    another before it is left out, and one that a few steps lead to a minimum found before is
    followed no further.
    """
    found: list[Minimum] = []
    begun: list[Minimum] = []
    for chi2, start in starts:
        begun.append(Minimum(start, chi2, False, ""))
        if any(_alike(problem, begun[-1], other) for other in begun[:-1]):
            continue
        one = problem.solve(start, atol=atol, most_steps=_FEW_STEPS if found else MAX_STEPS)
        if any(_alike(problem, one, other) for other in found):
            continue
        if not one.converged:
            one = problem.solve(one.x, atol=atol)
        found.append(one)
    return sorted(found, key=_depth)


def _alike(problem: Problem, one: Minimum, other: Minimum) -> bool:
    """True if one lies beside the other, hardly above it."""
    near = _NEARBY * (problem.high - problem.low)
    higher = one.chi2 - other.chi2
    beside = bool(np.all(np.abs(one.x - other.x) <= near))
    return beside and 0 <= higher <= _ALIKE * other.chi2


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


def _has_level(problem: Problem) -> bool:
    return any(p.level for p in problem.model.parameters)


def _levelled(problem: Problem, x: FloatArray) -> FloatArray:
    """Start x (K,) with the level adjusted to the data, and the scales with it, shapes held."""
    if not _has_level(problem):
        return x
    parameters = enumerate(problem.model.parameters)
    shapes = [i for i, p in parameters if not (p.scale or p.level)]
    return problem.solve(x, shapes, rtol=_LEVEL_RTOL).x


def deepest(problem: Problem, x: FloatArray, others: Iterable[FloatArray]) -> Minimum:
    """Minimum from x (K,), in the model's units, or from any of the others that lies lower."""
    found = problem.solve(x)
    for other in others:
        if problem.chi2(other) < found.chi2 * (1 - LOWER):
            found = min(found, problem.solve(other), key=_depth)
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
