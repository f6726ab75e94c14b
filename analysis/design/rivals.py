"""Models that a design must tell from the assumed one: those that could pass for it.

A rival is fitted to the values that the assumed model has at the design; what it then predicts
wrongly elsewhere, in units of the uncertainty, tells the two apart (T-optimality: Atkinson and
Fedorov 1975).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.choice.ladder import physics
from analysis.data.measurements import Measurements
from analysis.design.information import Information
from analysis.design.space_filling import farthest
from analysis.fit.first_fit import FirstFits, enough_points
from analysis.fit.search.levenberg_marquardt import Minimum
from analysis.fit.search.problem import Problem
from analysis.models import MODELS
from analysis.models.special_cases import special_cases
from instrument.geometry import BoolArray, FloatArray, IntArray

TOLD_APART = 100.0
"""chi2 by which the best fit of a rival misses the values: no fit of some 60 points hides that."""

MOST = 3
"""Rivals that a design regards."""

_TRIED = 6  # candidates with the largest differences to which a rival is fitted

_FITTED = 60  # candidates to which every model is fitted first

_SAME = 1.0  # chi2 at all candidates together, below which no design tells a rival apart


@dataclass(frozen=True, slots=True, kw_only=True)
class Rival:
    """Another model: its problem at all N candidates, with the assumed model's values as data.

    x: parameters (K,) of its best fit to all of them; chi2: of that fit.
    """

    name: str
    problem: Problem
    x: FloatArray
    chi2: float

    @classmethod
    def fitted(cls, problem: Problem, start: FloatArray) -> Rival:
        """Fit a model to all candidates, from `start` (K,) in the units of its parameters."""
        found = problem.solve(start)
        return cls(name=problem.model.name, problem=problem, x=found.x, chi2=found.chi2)

    def best(self, design: BoolArray) -> Minimum:
        """Best fit to a design, a mask (N,), with its parameters in their units."""
        return self.problem.subset(design).solve(self.x)

    def missed(self, design: BoolArray) -> float:
        """chi2, in units of u^2, of the best fit to a design (N,)."""
        return float(self.best(design).chi2)

    def differences(self, design: BoolArray, best: Minimum | None = None) -> FloatArray:
        """Amount (N,) by which each further candidate would raise `missed`, to first order.

        The squared difference from the best fit to the design, in units of its uncertainty: what
        a small move of the fit or the shared errors could explain as well does not count. best:
        that fit, where it is known.
        """
        x = (self.best(design) if best is None else best).x
        information = Information.of(self.problem, x)
        rows = information.rows
        off = (self.problem.brdf - self.problem.predict(x)) / self.problem.covariance.u_independent
        inverse = information.covariance(design.astype(np.float64))
        explained = rows @ (inverse @ (rows[design].T @ off[design]))
        spread = 1 + np.sum((rows @ inverse) * rows, axis=1)
        return np.where(design, 0.0, np.square(off - explained) / spread)


def leading(problem: Problem, m: Measurements, names: Iterable[str]) -> tuple[Rival, ...]:
    """Rivals among the named models, those first that come closest to the assumed one.

    problem: the assumed model's, at all candidates; m: the same as measurements. Models that have
    its values everywhere are left out: those of which it is a special case, or of the same physics
    by another method; and those with too many parameters for the candidates.
    """
    few = replace(m, brdf=problem.brdf).subset(farthest(m.geometry, min(m.size, _FITTED)))
    fits, found = FirstFits(few), []
    own = physics(problem.model.name)
    for model in (MODELS[name] for name in names):
        cases = (model.name, *(case.name for case in special_cases(model)))
        if own not in map(physics, cases) and enough_points(model, few):
            first = fits.of(model)
            assumed = replace(problem, model=first.problem.model)
            found.append(Rival.fitted(assumed, first.solution.x))
    found = [rival for rival in found if rival.chi2 > _SAME]
    return tuple(sorted(found, key=lambda rival: (rival.chi2, rival.name))[:MOST])


def telling_apart(
    rivals: Sequence[Rival],
    seconds: Callable[[BoolArray], FloatArray],
    design: BoolArray,
    most: int,
    order: IntArray,
) -> BoolArray:
    """Choose up to `most` candidates (N,) that tell the rivals from the assumed model.

    Each is for the rival that the design so far tells least, by what it adds to that one's chi2 in
    each of the `seconds` (N,) that it takes. It ends where all are told apart. design, and the
    result, are in `order` (N,) of the rivals' candidates.
    """
    extra = np.zeros(design.size, dtype=bool)
    for _ in range(most if rivals else 0):
        now = np.zeros(design.size, dtype=bool)
        now[order] = design | extra
        chi2, number = min((rival.missed(now), k) for k, rival in enumerate(rivals))
        if chi2 >= TOLD_APART:
            break
        extra[_next(rivals[number], now, seconds(design | extra), order)] = True
    return extra


def _next(rival: Rival, now: BoolArray, seconds: FloatArray, order: IntArray) -> int:
    """Place in the order of the candidate that adds most to a rival's chi2 in each second.

    The first-order differences name a few, to which the rival is fitted: its fit may escape.
    """
    worth = np.where(now[order], -1.0, rival.differences(now)[order] / seconds)
    tried = np.argsort(-worth, kind="stable")[:_TRIED]
    before, found = rival.missed(now), []
    for place in tried[worth[tried] >= 0]:
        more = now.copy()
        more[order[place]] = True
        found.append(((rival.missed(more) - before) / seconds[place], -int(place)))
    return -max(found)[1]
