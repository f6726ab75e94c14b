"""Where a parameter may lie: its profile-likelihood interval.

The interval holds every value at which the other parameters, fitted anew, keep chi2 within `rise`
of its minimum: 3.84, the 95 % point of chi2 with one degree of freedom, gives 95 % (Wilks 1938).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from analysis.fit.levenberg_marquardt import Minimum
from analysis.fit.problem import Problem
from instrument.geometry import FloatArray

RISE_95 = 3.84

# The search for an end begins no nearer than this part of the domain, widens by this factor, and
# stops at this part of the distance; the other parameters' chi2 is known to this part of `rise`.
_NEAREST, _WIDEN, _RELATIVE, _SETTLED = 1e-9, 3.0, 0.01, 1e-3
# What a shape changes over its whole domain counts as nothing below this part of what is allowed.
_UNSEEN = 0.01


def interval(
    problem: Problem, best: Minimum, index: int, rise: float = RISE_95
) -> tuple[float, float]:
    """Profile-likelihood interval of the parameter at `index`, in its own unit.

    An end on a bound of the domain means that the data do not limit the parameter on that side.
    """
    solved = {float(best.x[index]): best}
    profile = _Profile(problem, best, index, rise, _hidden(problem, best.x, index, rise), solved)
    return profile.end(float(problem.low[index])), profile.end(float(problem.high[index]))


def _hidden(problem: Problem, x: FloatArray, index: int, rise: float) -> list[int]:
    """The shapes that change nothing where the scale at `index` is as small as it may be."""
    parameters = problem.model.parameters
    shapes = [i for i, p in enumerate(parameters) if not p.scale and x[i] > p.low]
    if not parameters[index].scale or not shapes:
        return []
    without = x.copy()
    without[index] = problem.low[index]
    slopes = np.linalg.norm(problem.jacobian(without, shapes), axis=0)
    changes = slopes * (problem.high - problem.low)[shapes]
    unseen = changes < _UNSEEN * math.sqrt(rise)
    return [i for i, nothing in zip(shapes, unseen, strict=True) if nothing]


@dataclass(frozen=True, slots=True)
class _Profile:
    """chi2 over one parameter, the others fitted anew; `solved` has what was found so far.

    hidden: parameters that say nothing where this one is 0, as a lobe's width of its strength. At
    their lower bounds even a strong lobe may lie unseen between the points.
    """

    problem: Problem
    best: Minimum
    index: int
    rise: float
    hidden: list[int]
    solved: dict[float, Minimum]

    def excess(self, value: float) -> float:
        """How far chi2 is above what is allowed, as a root: about linear in the distance."""
        if value not in self.solved:
            self.solved[value] = self._solve(value)
        above = max(self.solved[value].chi2 - self.best.chi2, 0.0)
        return math.sqrt(above) - math.sqrt(self.rise)

    def _solve(self, value: float) -> Minimum:
        """The others fitted from the first start that leads to where chi2 is allowed."""
        for start in self._starts(value):
            x = start.copy()
            x[self.index] = value
            at = Minimum(x, self.problem.chi2(x), True, "")
            if at.chi2 - self.best.chi2 > self.rise:  # else no need: a fit only lowers chi2
                at = self.problem.solve(x, [self.index], enough=_SETTLED * self.rise)
            if at.chi2 - self.best.chi2 <= self.rise:
                break
        return at

    def _starts(self, value: float) -> Iterator[FloatArray]:
        """What was found at the nearest value, the best fit, and what may lie hidden."""
        yield self.solved[min(self.solved, key=lambda known: abs(known - value))].x
        yield self.best.x
        if self.hidden:
            narrow = self.best.x.copy()
            narrow[self.hidden] = self.problem.low[self.hidden]
            yield narrow

    def end(self, bound: float) -> float:
        """The end towards a bound of the domain."""
        middle = float(self.best.x[self.index])
        if middle == bound or self.excess(bound) <= 0:
            return bound
        inner, outer = self._bracket(middle, bound)
        return float(brentq(self.excess, inner, outer, xtol=_RELATIVE * abs(outer - middle)))

    def _bracket(self, middle: float, bound: float) -> tuple[float, float]:
        """A value inside the interval and one outside, which lies no further than the bound."""
        inner, away = middle, math.copysign(self._first_step(), bound - middle)
        while abs(away) < abs(bound - middle):
            outer = middle + away
            if self.excess(outer) > 0:
                return inner, outer
            inner, away = outer, away * _WIDEN
        return inner, bound

    def _first_step(self) -> float:
        """The distance at which the parameter alone would raise chi2 by `rise`, roughly."""
        domain = float(self.problem.high[self.index] - self.problem.low[self.index])
        slope = float(np.linalg.norm(self.problem.jacobian(self.best.x, [self.index])))
        return max(_NEAREST * domain, min(domain, math.sqrt(self.rise) / max(slope, 1e-300)))
