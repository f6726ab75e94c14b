"""Choice of a few geometries from a list: those that teach most in each second of bench time.

Most points are for the parameters: the A-criterion (of one parameter the c-criterion) times the
time that the design takes, point by point and then by exchange (Fedorov 1972), from several starts.
A fifth, at least, are spread over the whole list, where a lack of fit would show. Up to another
fifth tell the model from its rivals (T-optimality: Atkinson and Fedorov 1975), as far as the others
do not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.design.information import Information
from analysis.design.posterior import Posterior
from analysis.design.rivals import Rival, telling_apart
from analysis.design.space_filling import farthest
from instrument.geometry import BoolArray, FloatArray, Geometry, IntArray

LACK_OF_FIT, RIVALS = "lack of fit", "other models"
SHARE = 0.2  # of the points, for lack of fit, and at most for telling models apart

_STARTS = 4  # random ones of the exchange, besides the greedy one
_ROUNDS = 50  # of the exchange
_BETTER = 1e-9  # relative decrease of the criterion that counts


@dataclass(frozen=True, slots=True, kw_only=True)
class Costs:
    """Time on the bench: point_s (N,) for each candidate, and setting_s (M,) for each lamp setting.

    setting: (N,), number of each candidate's lamp setting. fixed_s: time of any scan.
    """

    point_s: FloatArray
    setting: IntArray
    setting_s: FloatArray
    fixed_s: float = 0.0

    def total_s(self, chosen: BoolArray) -> float:
        """Time of a design (N,) in s."""
        settings = np.unique(self.setting[chosen])
        return float(self.fixed_s + self.point_s[chosen].sum() + self.setting_s[settings].sum())

    def one_more_s(self, chosen: BoolArray) -> FloatArray:
        """Time (N,) in s that each candidate would add to a design."""
        new = np.ones(self.setting_s.size, dtype=bool)
        new[self.setting[chosen]] = False
        return np.asarray(self.point_s + np.where(new, self.setting_s, 0.0)[self.setting])

    def ordered(self, order: IntArray) -> Costs:
        """The same for the candidates in another order, indices (N,)."""
        return Costs(
            point_s=self.point_s[order],
            setting=self.setting[order],
            setting_s=self.setting_s,
            fixed_s=self.fixed_s,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidates:
    """N geometries (N,) to choose from, their information and their time on the bench."""

    geometry: Geometry
    information: Information
    costs: Costs


@dataclass(frozen=True, slots=True)
class Pick:
    """Chosen candidate: its number in the list, and the parameter or other reason it is for."""

    candidate: int
    reason: str


def choose(
    candidates: Candidates,
    asked: Sequence[str],
    count: int,
    *,
    rivals: Sequence[Rival] = (),
    goal: Mapping[str, float] | None = None,
    share: float = SHARE,
    seed: int = 0,
) -> tuple[Pick, ...]:
    """Choose `count` different candidates for the parameters `asked`, in the list's order.

    rivals: other models, with problems of the same candidates. goal: u wanted of each parameter
    asked for, in its unit; without it they count alike. share: of the points, for lack of
    fit. seed: of the random starts. Raises `ValueError` for a count beyond the candidates, or a
    parameter that the model does not have.
    """
    _require(candidates, asked, count)
    order = _canonical(candidates.geometry)
    listed = _List.of(candidates, asked, order, goal)
    spread = math.ceil(share * count)
    apart = math.floor(share * count) if rivals else 0
    fixed = listed.spread(spread)
    own = listed.best(fixed, count - spread - apart, seed)
    extra = telling_apart(rivals, listed.seconds, fixed | own, apart, order)
    own = listed.best(fixed | extra, count - spread - int(extra.sum()), seed)
    reasons = {int(k): LACK_OF_FIT for k in np.flatnonzero(fixed)}
    reasons |= {int(k): RIVALS for k in np.flatnonzero(extra)}
    reasons |= listed.reasons(fixed | extra, own)
    return tuple(sorted((Pick(int(order[k]), why) for k, why in reasons.items()), key=_number))


def _number(pick: Pick) -> int:
    return pick.candidate


def _require(candidates: Candidates, asked: Sequence[str], count: int) -> None:
    total, names = len(candidates.information.rows), candidates.information.names
    if not 1 <= count <= total:
        raise ValueError(f"{count} geometries; allowed: 1 to {total}, the candidates")
    for name in asked:
        if name not in names:
            raise ValueError(f"{name} is no parameter of the model; allowed: {', '.join(names)}")
    if not asked:
        raise ValueError(f"no parameter is asked for; allowed: some of {', '.join(names)}")


def _canonical(geometry: Geometry) -> IntArray:
    """Order (N,) of the candidates that does not depend on the one in which they are given."""
    keys = (geometry.dphi_deg, geometry.theta_r_deg, geometry.theta_i_deg)
    return np.lexsort([np.round(np.ravel(key), 9) for key in keys]).astype(np.int64)


@dataclass(frozen=True, slots=True, kw_only=True)
class _List:
    """Candidates in canonical order, with the weights (K + S,) of the parameters asked for."""

    geometry: Geometry
    information: Information
    costs: Costs
    weights: FloatArray
    asked: tuple[str, ...]

    @classmethod
    def of(
        cls,
        candidates: Candidates,
        asked: Sequence[str],
        order: IntArray,
        goal: Mapping[str, float] | None,
    ) -> _List:
        whole, g = candidates.information, candidates.geometry
        information = replace(whole, rows=whole.rows[order])
        weights = information.weights(asked, goal)
        return cls(
            geometry=Geometry(g.theta_i_deg[order], g.theta_r_deg[order], g.dphi_deg[order]),
            information=information,
            costs=candidates.costs.ordered(order),
            weights=weights,
            asked=tuple(whole.names[k] for k in np.flatnonzero(weights)),
        )

    @property
    def none(self) -> BoolArray:
        """Empty design."""
        return np.zeros(len(self.information.rows), dtype=bool)

    def seconds(self, chosen: BoolArray) -> FloatArray:
        """Time (N,) that one more candidate would take."""
        return self.costs.one_more_s(chosen)

    def spread(self, count: int) -> BoolArray:
        """Candidates (N,) spread over the list, each the farthest from those before it."""
        return farthest(self.geometry, count)

    def best(self, fixed: BoolArray, count: int, seed: int) -> BoolArray:
        """Best `count` candidates (N,) beside those `fixed`: of a greedy and of random starts."""
        if count == 0:
            return self.none
        rng = np.random.default_rng(seed)
        free = np.flatnonzero(~fixed)
        starts = [self._greedy(fixed, count)]
        for _ in range(_STARTS):
            start = self.none
            start[rng.choice(free, count, replace=False)] = True
            starts.append(start)
        found = [self._exchanged(fixed, start) for start in starts]
        return min(found, key=lambda one: self._objective(fixed | one))

    def _objective(self, chosen: BoolArray) -> float:
        """Criterion times time: the inverse of the information gained per second."""
        known = Posterior(self.information, self.weights, chosen)
        return known.criterion * self.costs.total_s(chosen)

    def _greedy(self, fixed: BoolArray, count: int) -> BoolArray:
        own = self.none
        known = Posterior(self.information, self.weights, fixed)
        for _ in range(count):
            point = self._next(known, fixed | own)[0]
            own[point] = True
            known.add(point)
        return own

    def _next(self, known: Posterior, chosen: BoolArray) -> tuple[int, float]:
        """Best candidate to add to a design, and the objective with it."""
        time_s = self.costs.total_s(chosen) + self.costs.one_more_s(chosen)
        value = np.where(chosen, np.inf, known.with_one_more() * time_s)
        point = int(np.argmin(value))
        return point, float(value[point])

    def _exchanged(self, fixed: BoolArray, start: BoolArray) -> BoolArray:
        """Exchange single points for better ones until none is better."""
        own, best = start.copy(), self._objective(fixed | start)
        for _ in range(_ROUNDS):
            before = best
            known = Posterior(self.information, self.weights, fixed | own)
            for point in np.flatnonzero(own):
                known.remove(int(point))
                own[point] = False
                other, value = self._next(known, fixed | own)
                taken = other if value < best * (1 - _BETTER) else int(point)
                best = value if taken == other else best
                own[taken] = True
                known.add(taken)
            if best >= before * (1 - _BETTER):
                break
        return own

    def reasons(self, fixed: BoolArray, own: BoolArray) -> dict[int, str]:
        """Parameter that each of the `own` points (N,) is for: whose variance it lowers most."""
        known = Posterior(self.information, self.weights, fixed | own)
        return {
            int(k): self.asked[int(np.argmax(known.without(int(k)) / known.variance))]
            for k in np.flatnonzero(own)
        }
