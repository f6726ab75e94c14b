"""Next points of an adaptive scan: those that teach most in each second of bench time.

One point of a batch may tell the leading models apart; as many as make up a fifth of the scan are
for lack of fit, the farthest from all before them; the others lower the u of the parameters asked
for. Where noise is most of what is left, these take more frames: that costs less than the way to
another point.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from acquisition.adaptive.aims import MARGIN, Aims
from acquisition.adaptive.knowledge import Knowledge
from acquisition.design.forecast import Forecast
from analysis.choice.ladder import physics
from analysis.design.information import Information
from analysis.design.optimal import LACK_OF_FIT, RIVALS, SHARE
from analysis.design.posterior import Posterior
from analysis.design.rivals import MOST as MOST_RIVALS
from analysis.design.rivals import Rival
from analysis.design.space_filling import farthest_from
from analysis.fit.fit import FitResult
from instrument.geometry import BoolArray, FloatArray, IntArray

MOST = 8
"""Most frames of a point, in units of the protocol's."""

_TOLD = 100.0  # chi2, to first order, beyond which a point more need not tell two models apart
_LEAST = 2  # points of a batch, even where fewer may reach the goal
_STEP, _SEARCHES = 1.6, 11  # of the search for the best count
_SMALL = 0.02  # share of a point in units of the largest, below which it is left out
_ROUNDS = 20  # of the weights, for each count
_NOTHING = 1e-4  # share in units of the largest, below which a point does not come back


@dataclass(frozen=True, slots=True)
class Pick:
    """Chosen candidate with its reason and its frames, in units of the protocol's."""

    candidate: int
    reason: str
    multiple: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Costs:
    """Bench time of N candidates: usual move_s and frames_s (N,), and way_s (M,) to each setting.

    setting: (N,), number of each candidate's setting of the lamp. view_deg: (N,), its view angle;
    here_deg: that at which the camera stands. per_deg_s: time of a degree that the camera turns.
    """

    move_s: FloatArray
    frames_s: FloatArray
    way_s: FloatArray
    setting: IntArray
    view_deg: FloatArray
    here_deg: float
    per_deg_s: float

    def alone_s(self, multiples: IntArray) -> FloatArray:
        """Return the time (N,) in s of points with so many frames (N,), without their ways."""
        return np.asarray(self.move_s + multiples * self.frames_s)

    def one_more_s(self, batch: BoolArray, multiple: int = 1) -> FloatArray:
        """Return the time (N,) in s that each candidate would add to a batch, a mask (N,).

        The views of a setting are measured in one go: one between them adds no way of its own.
        """
        way_s, outside_deg = self.way_s.copy(), np.zeros(self.view_deg.size)
        for number in range(way_s.size):
            own, taken = self.setting == number, batch & (self.setting == number)
            ends = self.view_deg[taken] if taken.any() else np.array([self.here_deg])
            way_s[number] *= not taken.any()
            below, above = ends.min() - self.view_deg[own], self.view_deg[own] - ends.max()
            outside_deg[own] = np.maximum(np.maximum(below, above), 0.0)
        point_s = self.move_s + multiple * self.frames_s
        return np.asarray(point_s + way_s[self.setting] + self.per_deg_s * outside_deg)


class NextPoints:
    """Choice among the N candidates of a forecast for the leading model, given those chosen.

    multiples: (N,), frames of those chosen in units of the protocol's, as a ratio, 0 of the others.
    """

    def __init__(
        self, every: Forecast, costs: Costs, multiples: IntArray, known: Knowledge, aims: Aims
    ) -> None:
        self.every, self._costs, self._aims = every, costs, aims
        self._noise, self._multiples = every.averaged, multiples
        self._information = every.information
        self._weights = self._information.weights(aims.u, aims.u)
        self._chosen = multiples > 0
        self._once = self._information.rows
        own = self._by_frames(1)
        self._known = own.matrix(self._chosen.astype(np.float64))
        self._posterior = Posterior(own, self._weights, self._chosen)
        self._rivals = list(_rivals(known, every))
        self.asked = [n for n in self._information.names if n in aims.u]

    def u_measured(self, design: BoolArray) -> dict[str, float]:
        """Return the u, in its unit, of each parameter asked for by chosen points, a mask (N,)."""
        return self._u(self._by_frames(1), design)

    def u_floor(self) -> dict[str, float]:
        """Return the u, in its unit, by every candidate with the most frames."""
        return self._u(self._by_frames(MOST), np.ones(self._chosen.size, dtype=bool))

    def _u(self, information: Information, design: BoolArray) -> dict[str, float]:
        found = information.u(design.astype(np.float64))
        return {name: found[name] for name in self.asked}

    def _by_frames(self, multiple: int) -> Information:
        """Information where points that are not chosen yet have so many times the frames."""
        times = np.where(self._chosen, np.maximum(self._multiples, 1), multiple)
        smaller = np.sqrt(self._noise / times + 1 - self._noise)
        rows = self._information.rows / smaller[:, np.newaxis]
        return replace(self._information, rows=rows)

    def pick(
        self, size: int, spread: int, allowed: BoolArray, ratio: Mapping[str, float]
    ) -> tuple[list[Pick], float]:
        """Return up to `size` candidates, of those allowed (N,), with reasons and frames.

        And the logarithm by which they lower the sum of squared u, in units of those wanted, per
        second. spread: points for lack of fit so far. ratio: factor on the forecast u of each
        parameter; beyond the goal nothing counts.
        """
        times, rate = self._times(size, allowed, ratio)
        reasons = self._reasons(times)
        apart = self._telling(allowed & ~self._chosen & (times == 0), allowed & False)
        if apart is not None:
            reasons[apart] = RIVALS
        self._spread(reasons, spread, allowed)
        return [Pick(k, why, max(int(times[k]), 1)) for k, why in reasons.items()], rate

    def _times(
        self, size: int, allowed: BoolArray, ratio: Mapping[str, float]
    ) -> tuple[IntArray, float]:
        """Return the frames (N,) of the best further points, in units of the protocol's, a ratio.

        Of the best weights of designs that add to what is chosen (`analysis.design.bound`), the
        count for which u falls most per second, on the way to the goal; 0 for the others.
        """
        free = allowed & ~self._chosen
        share, count = free / max(free.sum(), 1), float(_LEAST)
        target = self._target(ratio)
        way = math.log(max(self._criterion(np.zeros(free.size, dtype=np.int64)) / target, 1.0))
        found = [(np.zeros(free.size, dtype=np.int64), -1.0)]
        for _ in range(_SEARCHES if free.any() else 0):
            share = self._better(share, count)
            times = self._pruned(_rounded(share, count, size), target)
            left = math.log(max(self._criterion(times) / target, 1.0))
            found.append((times, (way - left) / self._spent_s(times)))
            if left == 0:
                break
            count *= _STEP
        return max(found, key=lambda pair: pair[1])

    def _pruned(self, times: IntArray, target: float) -> IntArray:
        """Return fewer points, with frames (N,) as a ratio, that still reach a sum of squared u.

        Those go first whose time gains least. Points that do not reach it are returned as they are.
        """
        if self._criterion(times) > target:
            return times
        kept = times.copy()
        while np.count_nonzero(kept) > 1:
            own = np.flatnonzero(kept)
            cross, inverse = self._posterior.cross[own], self._inverse(kept)
            seen = inverse @ cross
            now = float(self._posterior.criterion - np.sum(cross * seen))
            lost = np.square(seen).sum(axis=1) / np.maximum(np.diag(inverse), 1e-9)
            least = int(np.argmin(lost / self._costs.alone_s(kept)[own]))
            if now + lost[least] > target:
                break
            kept[own[least]] = 0
        return kept

    def _inverse(self, times: IntArray) -> FloatArray:
        """Inverse covariance (M, M) of the readings of M further points, with frames (N,).

        In units of their independent u, and before they are measured (Woodbury).
        """
        own = np.flatnonzero(times)
        noise = np.diag(1 / self._information_of(times)[own])
        return np.asarray(np.linalg.inv(self._posterior.predicted[np.ix_(own, own)] + noise))

    def _information_of(self, times: IntArray) -> FloatArray:
        """Weights (N,) of further points in the information, as a ratio: what frames average."""
        averaged = self._noise / np.maximum(times, 1) + 1 - self._noise
        return np.where(times > 0, 1 / averaged, 0.0)

    def _target(self, ratio: Mapping[str, float]) -> float:
        """Return the sum of squared u, in units of those wanted, at which each may be reached."""
        return sum((MARGIN / ratio[name]) ** 2 for name in self.asked)

    def _better(self, share: FloatArray, count: float) -> FloatArray:
        """Improve the shares (N,), of a sum of 1 and as a ratio, of a design of so many points."""
        aims = np.diag(np.sqrt(self._weights))[:, self._weights > 0]
        used = np.flatnonzero(share > _NOTHING * share.max())
        rows, own = self._once[used], share[used]
        for _ in range(_ROUNDS):
            matrix = self._known + (rows * (count * own)[:, np.newaxis]).T @ rows
            own = own * np.sqrt(np.square(rows @ np.linalg.solve(matrix, aims)).sum(axis=1))
            own = own / own.sum()
        found = np.zeros(share.size)
        found[used] = own
        return found

    def _parts(self, times: IntArray) -> dict[str, float]:
        """Return the u of each parameter in units of that wanted, with further frames (N,)."""
        cross = self._posterior.cross[np.flatnonzero(times)]
        variance = self._posterior.variance - np.sum(cross * (self._inverse(times) @ cross), axis=0)
        return dict(zip(self.asked, np.sqrt(variance).tolist(), strict=True))

    def _criterion(self, times: IntArray) -> float:
        return sum(part**2 for part in self._parts(times).values())

    def _reasons(self, times: IntArray) -> dict[int, str]:
        """Return the parameter that each further point is for: whose variance it lowers most."""
        once = (times > 0).astype(np.int64)
        own = np.flatnonzero(once)
        part = np.square(self._inverse(once) @ self._posterior.cross[own])
        variance = np.square([*self._parts(once).values()])
        return {
            int(k): self.asked[int(np.argmax(row))]
            for k, row in zip(own, part / variance, strict=True)
        }

    def _spread(self, reasons: dict[int, str], spread: int, allowed: BoolArray) -> None:
        """Add points for lack of fit, until they are a fifth of all: the farthest from others."""
        taken, geometry = self._chosen.copy(), self.every.measurements.geometry
        taken[list(reasons)] = True
        while spread < SHARE * taken.sum():
            far = farthest_from(geometry, taken, allowed)
            if far is None:
                return
            taken[far], reasons[far], spread = True, LACK_OF_FIT, spread + 1

    def _spent_s(self, times: IntArray) -> float:
        """Return the time of further points with so many frames (N,), as a ratio."""
        batch, spent_s = np.zeros(self._chosen.size, dtype=bool), 0.0
        for point in np.flatnonzero(times):
            spent_s += float(self._costs.one_more_s(batch, int(times[point]))[point])
            batch[point] = True
        return spent_s

    def _telling(self, free: BoolArray, batch: BoolArray) -> int | None:
        """Return the candidate that tells the closest rival best; None where all are told apart."""
        if not free.any():
            return None
        seconds = self._costs.one_more_s(batch)
        for rival in self._rivals:
            best = rival.best(self._chosen)
            if best.chi2 < _TOLD:
                worth = np.where(free, rival.differences(self._chosen, best) / seconds, -1.0)
                return int(np.argmax(worth))
        return None


def _rounded(share: FloatArray, count: float, size: int) -> IntArray:
    """Return whole numbers of frames (N,), as a ratio, for the `size` largest shares (N,) at most.

    What the smaller ones would have is theirs.
    """
    largest = np.argsort(-share, kind="stable")[:size]
    kept = largest[share[largest] >= _SMALL * share[largest[0]]]
    times = np.zeros(share.size, dtype=np.int64)
    times[kept] = np.clip(np.round(count * share[kept] / share[kept].sum()), 1, MOST)
    return times


def _rivals(known: Knowledge, every: Forecast) -> Iterator[Rival]:
    """Yield the other candidates that describe the readings best, those of other physics."""
    if known.choice is None or known.leading is None or every.measurements.relative:
        return  # relative values: the forecast's factor is not that of the rival's fit
    own, seen = known.leading, {physics(known.leading.model)}
    others = sorted((c for c in known.choice.candidates if c.converged), key=lambda c: c.bic)
    for other in others:
        if len(seen) > MOST_RIVALS:
            return
        if physics(other.model) not in seen and not _contains(other, own):
            seen.add(physics(other.model))
            problem = replace(every.problem, model=other.problem.model)
            yield Rival(name=other.model, problem=problem, x=other.x, chi2=0.0)


def _contains(other: FitResult, own: FitResult) -> bool:
    """Return True for a sum with all terms of the leading model: it agrees wherever that does."""
    return set(physics(own.model).split("+")) < set(physics(other.model).split("+"))
