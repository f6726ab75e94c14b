"""Where a parameter may lie: its profile-likelihood interval.

The interval holds every value at which the other parameters, fitted anew, keep chi2 within `rise`
of its minimum: 3.84, the 95 % point of chi2 with one degree of freedom, gives 95 % (Wilks 1938).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

from analysis.descent import Minimum
from analysis.problem import Problem

RISE_95 = 3.84

# The search for an end starts no nearer than this part of the domain, widens by this factor, and
# stops at this part of the distance.
_NEAREST, _WIDEN, _RELATIVE = 1e-9, 3.0, 0.01


def interval(
    problem: Problem, best: Minimum, index: int, rise: float = RISE_95
) -> tuple[float, float]:
    """Profile-likelihood interval of the parameter at `index`, in its own unit.

    An end on a bound of the domain means that the data do not limit the parameter on that side.
    """
    return (
        _end(problem, best, index, float(problem.low[index]), rise),
        _end(problem, best, index, float(problem.high[index]), rise),
    )


def _end(problem: Problem, best: Minimum, index: int, bound: float, rise: float) -> float:
    middle = float(best.x[index])
    if middle == bound:
        return bound

    def excess(value: float) -> float:
        """How far chi2 is above what is allowed, as a root: about linear in the distance."""
        x = best.x.copy()
        x[index] = value
        chi2 = problem.chi2(x)
        if chi2 - best.chi2 > rise:  # else fitting the others is not needed: it only lowers chi2
            chi2 = problem.solve(x, [index]).chi2
        return math.sqrt(max(chi2 - best.chi2, 0.0)) - math.sqrt(rise)

    inner, outer = _bracket(excess, middle, bound, _first_step(problem, best, index, rise))
    if inner == outer:
        return bound
    return float(brentq(excess, inner, outer, xtol=_RELATIVE * abs(outer - middle)))


def _first_step(problem: Problem, best: Minimum, index: int, rise: float) -> float:
    """The distance at which the parameter alone would raise chi2 by `rise`, roughly."""
    domain = float(problem.high[index] - problem.low[index])
    slope = float(np.linalg.norm(problem.jacobian(best.x, [index])))
    return max(_NEAREST * domain, min(domain, math.sqrt(rise) / max(slope, 1e-300)))


def _bracket(
    excess: Callable[[float], float], middle: float, bound: float, step: float
) -> tuple[float, float]:
    """A value inside the interval and one outside; the bound twice where that is inside."""
    inner, away = middle, math.copysign(step, bound - middle)
    while True:
        outer = middle + away
        if abs(away) >= abs(bound - middle):
            outer = bound
        if excess(outer) > 0:
            return inner, outer
        if outer == bound:
            return bound, bound
        inner, away = outer, away * _WIDEN
