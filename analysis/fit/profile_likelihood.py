"""Profile-likelihood interval of one fitted parameter.

The interval holds every value at which chi2, minimised over the other parameters, stays within
`rise` of its minimum: 3.84, the 95 % point of chi2 with one degree of freedom, gives 95 % (Wilks
1938).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from analysis.fit.search.levenberg_marquardt import Minimum
from analysis.fit.search.problem import Problem
from instrument.geometry import FloatArray

RISE_95 = 3.84

# The search for an end starts at least this fraction of the domain away, grows by this factor, and
# ends at this fraction of the distance; chi2 of the other parameters is known to this part of rise.
_MIN_STEP, _GROWTH, _RTOL, _CHI2_TOLERANCE = 1e-9, 3.0, 0.01, 1e-3
# A shape parameter has no effect where it changes the data, over its whole domain, by less than
# this fraction of the allowed change.
_NO_EFFECT = 0.01


def interval(
    problem: Problem, best: Minimum, index: int, rise: float = RISE_95
) -> tuple[float, float]:
    """Profile-likelihood interval of the parameter at `index`, in its own unit.

    An end on a bound of the domain means that the data do not limit the parameter on that side.
    """
    solved = {float(best.x[index]): best}
    shapes = _undefined_shapes(problem, best.x, index, rise)
    profile = _Profile(problem, best, index, rise, shapes, solved)
    return profile.end(float(problem.low[index])), profile.end(float(problem.high[index]))


def _undefined_shapes(problem: Problem, x: FloatArray, index: int, rise: float) -> list[int]:
    """Indices of the shape parameters without effect where the scale at `index` is at its least."""
    parameters = problem.model.parameters
    shapes = [i for i, p in enumerate(parameters) if not p.scale and x[i] > p.low]
    if not parameters[index].scale or not shapes:
        return []
    without = x.copy()
    without[index] = problem.low[index]
    gradients = np.linalg.norm(problem.jacobian(without, shapes), axis=0)
    changes = gradients * (problem.high - problem.low)[shapes]
    no_effect = changes < _NO_EFFECT * math.sqrt(rise)
    return [i for i, without_effect in zip(shapes, no_effect, strict=True) if without_effect]


@dataclass(frozen=True, slots=True)
class _Profile:
    """chi2 as a function of one parameter, minimised over the others.

    undefined_shapes: parameters without effect where this one is 0, as the width of a lobe of
    strength 0. At their lower bounds even a strong lobe may fit unseen between the points.
    solved: the minima found so far, by value of the parameter.
    """

    problem: Problem
    best: Minimum
    index: int
    rise: float
    undefined_shapes: list[int]
    solved: dict[float, Minimum]

    def excess(self, value: float) -> float:
        """Root of the rise of chi2 less root of the allowed rise: about linear in the distance."""
        if value not in self.solved:
            self.solved[value] = self._solve(value)
        above = max(self.solved[value].chi2 - self.best.chi2, 0.0)
        return math.sqrt(above) - math.sqrt(self.rise)

    def _solve(self, value: float) -> Minimum:
        """Fit of the others, from the first start that reaches an allowed chi2."""
        for start in self._starts(value):
            x = start.copy()
            x[self.index] = value
            at = Minimum(x, self.problem.chi2(x), True, "")
            if at.chi2 - self.best.chi2 > self.rise:  # else not needed: a fit only lowers chi2
                at = self.problem.solve(x, [self.index], atol=_CHI2_TOLERANCE * self.rise)
            if at.chi2 - self.best.chi2 <= self.rise:
                break
        return at

    def _starts(self, value: float) -> Iterator[FloatArray]:
        """The solution at the nearest value, the best fit, and narrow shapes between points."""
        yield self.solved[min(self.solved, key=lambda known: abs(known - value))].x
        yield self.best.x
        if self.undefined_shapes:
            narrow = self.best.x.copy()
            narrow[self.undefined_shapes] = self.problem.low[self.undefined_shapes]
            yield narrow

    def end(self, bound: float) -> float:
        """End of the interval towards a bound of the domain."""
        middle = float(self.best.x[self.index])
        if middle == bound or self.excess(bound) <= 0:
            return bound
        from scipy.optimize import brentq  # heavy: most fits need no profile

        inner, outer = self._bracket(middle, bound)
        return float(brentq(self.excess, inner, outer, xtol=_RTOL * abs(outer - middle)))

    def _bracket(self, middle: float, bound: float) -> tuple[float, float]:
        """One value inside the interval and one outside, no further away than the bound."""
        inner, away = middle, math.copysign(self._first_step(), bound - middle)
        while abs(away) < abs(bound - middle):
            outer = middle + away
            if self.excess(outer) > 0:
                return inner, outer
            inner, away = outer, away * _GROWTH
        return inner, bound

    def _first_step(self) -> float:
        """Approximate distance at which this parameter alone would raise chi2 by `rise`."""
        domain = float(self.problem.high[self.index] - self.problem.low[self.index])
        gradient = float(np.linalg.norm(self.problem.jacobian(self.best.x, [self.index])))
        step = math.sqrt(self.rise) / max(gradient, 1e-300)
        return max(_MIN_STEP * domain, min(domain, step))
