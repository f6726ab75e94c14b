"""How well a fit determines its parameters: standard uncertainties, or intervals where none holds.

A standard uncertainty describes a parameter only where chi2 is about a parabola that fits into
the parameter's domain. Elsewhere (on a bound, or where the data hardly depend on the parameter)
the profile-likelihood interval is given instead. So it is where a standard uncertainty rests on
another parameter's lying on its bound: with an albedo of 1 that may as well be 0.5, a lobe's
strength is not known.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from analysis.descent import Minimum
from analysis.interval import RISE_95, interval
from analysis.models.base import BoolArray
from analysis.problem import Problem
from instrument.geometry import FloatArray

# Below this part of the largest singular value a combination of parameters is not determined.
_RANK = 1e-7
# A parameter moves the data at least so many standard deviations over all of its domain.
_LEAST_EFFECT = 1e-3
# An interval may differ by this factor from 1.96 u before u is held to be misleading.
_PARABOLA = 1.4


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """u by parameter name (None where none holds), intervals for those, and correlations.

    `undetermined` names the parameters that may lie anywhere in more than half of their domain.
    `correlation` is (K, K) in the model's order, NaN for a parameter that has no u.
    """

    u: Mapping[str, float | None]
    intervals: Mapping[str, tuple[float, float]]
    undetermined: tuple[str, ...]
    correlation: FloatArray


def uncertainty(
    problem: Problem,
    best: Minimum,
    variance: float,
    untied: Collection[str] = (),
    profiles: bool = True,
) -> Uncertainty:
    """Uncertainties of the parameters at a minimum, in their own units.

    `variance` is that of the whitened residuals: 1 where the data's u is stated, else estimated.
    `untied`: parameters that no reference ties down: not determined, whatever else may hint at
    them. Without `profiles` an interval is the whole domain.
    """
    bound = (best.x == problem.low) | (best.x == problem.high)
    C, loose = _linear(problem, best.x, variance, ~bound)
    leaning = _leaning(problem, best.x, variance, C, bound)
    u: dict[str, float | None] = {}
    intervals: dict[str, tuple[float, float]] = {}
    undetermined = []
    for i, parameter in enumerate(problem.model.parameters):
        linear = None if loose[i] else float(np.sqrt(C[i, i]))
        u[parameter.name] = linear
        tied = parameter.name not in untied
        firm = tied and linear is not None and not leaning[i]
        if firm and _inside(problem, best.x, i, 2 * (linear or 0.0)):
            continue
        ends = parameter.low, parameter.high
        if profiles:
            ends = interval(problem, best, i, RISE_95 * variance)
        if tied and linear is not None and _parabola(problem, float(best.x[i]), i, linear, ends):
            continue
        u[parameter.name] = None
        intervals[parameter.name] = ends
        if not tied or ends[1] - ends[0] > (parameter.high - parameter.low) / 2:
            undetermined.append(parameter.name)
    return Uncertainty(u, intervals, tuple(undetermined), _correlation(C, list(u.values())))


def _leaning(
    problem: Problem, x: FloatArray, variance: float, C: FloatArray, bound: BoolArray
) -> BoolArray:
    """Parameters whose u rests on others' being held on a `bound`, which may leave it."""
    if not np.any(bound):
        return bound
    off = problem.off_level_bounds(x, range(x.size))
    freed, loose = _linear(problem, off, variance, np.ones_like(bound))
    wider = np.diag(freed) > _PARABOLA**2 * np.diag(C)
    return np.asarray(wider | loose)


def _linear(
    problem: Problem, x: FloatArray, variance: float, varied: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Linearised covariance of the `varied` parameters, (K, K), and which it does not hold for."""
    loose = ~varied
    C = np.full((x.size, x.size), np.nan)
    free = np.flatnonzero(varied)
    if free.size == 0:
        return C, loose
    J = problem.jacobian(x, free.tolist())
    norm = np.linalg.norm(J, axis=0)
    live = norm * (problem.high - problem.low)[free] > _LEAST_EFFECT * np.sqrt(variance)
    loose[free[~live]] = True
    free, J, norm = free[live], J[:, live], norm[live]
    if free.size == 0:
        return C, loose
    _, S, Vt = np.linalg.svd(J / norm, full_matrices=False)
    known = _RANK * S[0] < S
    loose[free] |= np.any(np.abs(Vt[~known]) > 0.1, axis=0)
    root = Vt[known].T / S[known]
    C[np.ix_(free, free)] = variance * (root @ root.T) / np.outer(norm, norm)
    return C, loose


def _inside(problem: Problem, x: FloatArray, i: int, distance: float) -> bool:
    return bool(problem.low[i] <= x[i] - distance and x[i] + distance <= problem.high[i])


def _parabola(problem: Problem, x: float, i: int, u: float, ends: tuple[float, float]) -> bool:
    """Whether the ends that lie within the domain are where u says, and there is one."""
    distances = [
        abs(end - x)
        for end, bound in zip(ends, (problem.low[i], problem.high[i]), strict=True)
        if end != bound
    ]
    expected = np.sqrt(RISE_95) * u
    return bool(distances) and all(
        expected / _PARABOLA < d < expected * _PARABOLA for d in distances
    )


def _correlation(C: FloatArray, u: list[float | None]) -> FloatArray:
    scale = np.array([np.nan if value is None else value for value in u])
    return np.asarray(C / np.outer(scale, scale))
