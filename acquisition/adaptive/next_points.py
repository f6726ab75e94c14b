"""Next points of an adaptive scan: those that teach most in each second of bench time.

One point of a batch may tell the leading models apart, more of them where the choice has changed;
as many as make up a fifth of the scan are for lack of fit, the farthest from all before them; the
others lower the u of the parameters asked for. Where noise is most of what is left and the way to a
point takes longer than its frames, these take more of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from acquisition.adaptive.aims import MARGIN, Aims
from acquisition.adaptive.knowledge import Knowledge
from acquisition.adaptive.rival_models import CONTESTED, rivals_of, telling_apart
from acquisition.design.forecast import Forecast
from acquisition.results.effects.lamp_level import DRIFT, WANDER
from analysis.data.covariance import VIEW
from analysis.design.information import Information
from analysis.design.optimal import LACK_OF_FIT, RIVALS, SHARE
from analysis.design.posterior import Posterior
from analysis.design.space_filling import farthest_from, nearest_to
from instrument.geometry import BoolArray, FloatArray, Geometry, IntArray

MOST = 8
"""Most frames of a point, in units of the protocol's."""

_ALONE = 4  # settings of the lamp, the nearest, at which a batch may stay
_BEYOND = 1e-3  # weight of a variance that is as small as asked


@dataclass(frozen=True, slots=True)
class Pick:
    """Chosen candidate with its reason and its frames, in units of the protocol's."""

    candidate: int
    reason: str
    multiple: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """Most points of a batch and of the way to the goal; `spread`: those so far for lack of fit."""

    batch: int
    way: int
    spread: int


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

    def one_more_s(self, batch: BoolArray, multiples: IntArray) -> FloatArray:
        """Return the time (N,) in s that each candidate would add to a batch, a mask (N,).

        multiples: frames (N,) of each candidate, as a ratio.

        The views of a setting are measured in one go: one between them adds no way of its own.
        """
        way_s, outside_deg = self.way_s.copy(), np.zeros(self.view_deg.size)
        for number in range(way_s.size):
            own, taken = self.setting == number, batch & (self.setting == number)
            ends = self.view_deg[taken] if taken.any() else np.array([self.here_deg])
            way_s[number] *= not taken.any()
            below, above = ends.min() - self.view_deg[own], self.view_deg[own] - ends.max()
            outside_deg[own] = np.maximum(np.maximum(below, above), 0.0)
        point_s = self.move_s + multiples * self.frames_s
        return np.asarray(point_s + way_s[self.setting] + self.per_deg_s * outside_deg)

    def one_less_s(self, batch: BoolArray, multiples: IntArray) -> FloatArray:
        """Return the time (N,) in s that each point of a batch, a mask (N,), takes in it.

        multiples: frames (N,) of each candidate, as a ratio. A point at an end of the views of its
        setting takes the way there from the next one, too; a single one that to the setting.
        """
        found = self.move_s + multiples * self.frames_s
        for number in np.unique(self.setting[batch]):
            own = np.flatnonzero(batch & (self.setting == number))
            views = self.view_deg[own]
            if own.size == 1:
                found[own] += self.way_s[number] + self.per_deg_s * abs(views - self.here_deg)
                continue
            for sign in (-1.0, 1.0):
                inner, end = np.argsort(sign * views, kind="stable")[-2:]
                beyond = max(sign * views[inner], sign * self.here_deg)
                found[own[end]] += self.per_deg_s * max(sign * views[end] - beyond, 0.0)
        return np.asarray(found)


class NextPoints:
    """Choice among the N candidates of a forecast for the leading model, given those chosen.

    multiples: (N,), frames of those chosen in units of the protocol's, as a ratio, 0 of the others.
    """

    def __init__(
        self, every: Forecast, costs: Costs, multiples: IntArray, known: Knowledge, aims: Aims
    ) -> None:
        self.every, self._costs, self._aims = every, costs, aims
        self._noise, self._multiples = every.averaged, multiples
        self._information = _without_drift(every.information)
        self._weights = self._information.weights(aims.u, aims.u)
        self._chosen = multiples > 0
        self._dwell = _best_multiples(self._noise / (1 + self._by_view()), costs)
        self._posterior = Posterior(self._by_frames(self._dwell), self._weights, self._chosen)
        self._doubted = known.verdict == "none adequate"
        self._worst = _worst(known)
        self._rivals = list(rivals_of(known, every))
        self._apart = CONTESTED if known.contested else 1
        self.asked = [n for n in self._information.names if n in aims.u]

    def _by_view(self) -> FloatArray:
        """Variance (N,) of each value by its view angle's own error, in units of the independent.

        A view that is measured again has it again: no further frames average it.
        """
        K = len(self._information.names)
        own = [k for k, name in enumerate(self._information.errors, K) if name.startswith(VIEW)]
        return np.asarray(np.square(self._information.rows[:, own]).sum(axis=1))

    def u_measured(self, design: BoolArray) -> dict[str, float]:
        """Return the u, in its unit, of each parameter asked for by chosen points, a mask (N,)."""
        return self._u(self._by_frames(self._dwell), design)

    def u_floor(self) -> dict[str, float]:
        """Return the u, in its unit, by every candidate with the most frames."""
        return self._u(self._by_frames(MOST), np.ones(self._chosen.size, dtype=bool))

    def _u(self, information: Information, design: BoolArray) -> dict[str, float]:
        found = information.u(design.astype(np.float64))
        return {name: found[name] for name in self.asked}

    def _by_frames(self, multiples: IntArray | int) -> Information:
        """Information where points that are not chosen yet have so many times the frames, (N,)."""
        times = np.where(self._chosen, np.maximum(self._multiples, 1), multiples)
        smaller = np.sqrt(self._noise / times + 1 - self._noise)
        rows = self._information.rows / smaller[:, np.newaxis]
        return replace(self._information, rows=rows)

    def pick(
        self, counts: Counts, allowed: BoolArray, ratio: Mapping[str, float]
    ) -> tuple[list[Pick], float]:
        """Return candidates, of those allowed (N,), that reach the goal, with reasons and frames.

        Or up to `counts.way` of them, where these do not reach it; and what they are worth, see
        `_worth`. ratio: factor on the forecast u of each; what is beyond the goal hardly counts.
        """
        target = self._target(ratio)
        if self._doubted and np.all(self._posterior.variance <= target):
            return self._looking(counts.batch, allowed), 0.0
        batch, worth = self._best(counts.way, allowed & ~self._chosen, target)
        free, once = allowed & ~self._chosen & ~batch, np.ones(batch.size, dtype=np.int64)
        seconds = self._costs.one_more_s(batch, once)
        apart = telling_apart(self._rivals, self._chosen, free, seconds, self._apart)
        reasons = dict.fromkeys(apart, RIVALS)
        self._spread(reasons, batch, counts.spread, allowed)
        known = self._posterior.copy()
        for point in reasons:  # they lower u as well
            known.add(point)
        batch = self._pruned(known, batch, target)
        reasons |= self._reasons(known, batch)
        times = np.where(batch, self._dwell, 1)
        return [Pick(k, why, int(times[k])) for k, why in reasons.items()], worth

    def _looking(self, size: int, allowed: BoolArray) -> list[Pick]:
        """Return points for lack of fit alone.

        No model holds, and the u of the leading one is small enough. Each second point is as near
        as can be to where that model fails most, so that a misfit is seen as no scatter; the others
        are the farthest from all before them.
        """
        taken, found = self._chosen.copy(), list[Pick]()
        geometry = self.every.measurements.geometry
        for number in range(size):
            if number % 2 and self._worst is not None:
                point = nearest_to(self._worst, geometry, taken, allowed)
            else:
                point = farthest_from(geometry, taken, allowed)
            if point is None:
                break
            taken[point] = True
            found.append(Pick(point, LACK_OF_FIT))
        return found

    def _best(self, most: int, free: BoolArray, target: FloatArray) -> tuple[BoolArray, float]:
        """Return the best further points, a mask (N,), and what they are worth.

        At all settings of the lamp, or at one alone: the way to another takes time. Each point is
        the one that lowers what is missed most, or most per second.
        """
        settings = self._costs.setting
        near = sorted(np.unique(settings[free]), key=lambda k: self._costs.way_s[k])[:_ALONE]
        parts = [free, *(free & (settings == k) for k in near)]
        found = [
            self._batch(most, part, target, hasty)
            for part in parts
            if part.any()
            for hasty in (False, True)
        ]
        return max(found, key=lambda pair: pair[1], default=(free & False, -1.0))

    def _batch(
        self, most: int, free: BoolArray, target: FloatArray, hasty: bool
    ) -> tuple[BoolArray, float]:
        """Return up to `most` of the free points, masks (N,), that are to reach the targets (P,).

        One after the other, each the one that lowers what is missed most; hasty: most per second.
        And what they are worth.
        """
        known, batch = self._posterior.copy(), np.zeros(free.size, dtype=bool)
        most = min(most, int(free.sum()))
        while batch.sum() < most and (np.any(known.variance > target) or not batch.any()):
            gain = _missed(known.variance, target)
            gain = gain - _missed(known.variances_with_one_more(), target)
            if hasty:
                gain = gain / self._costs.one_more_s(batch, self._dwell)
            point = int(np.argmax(np.where(free & ~batch, gain, -np.inf)))
            known.add(point)
            batch[point] = True
        batch = self._pruned(self._posterior, batch, target)
        return batch, self._worth(batch, target)

    def _worth(self, batch: BoolArray, target: FloatArray) -> float:
        """Return what a batch, a mask (N,), is worth, in 1/s: the larger, the better.

        The logarithm by which it lowers what is missed, per second. Of those that reach the targets
        (P,), each worth more than one that does not, the quickest is best.
        """
        spent_s = self._spent_s(batch)
        before = self._posterior.variance
        after = self._variances(self._posterior, batch)
        if np.all(after <= target):
            return 1e3 + 1e3 / spent_s
        return math.log(float(_missed(before, target) / _missed(after, target))) / spent_s

    def _pruned(self, known: Posterior, batch: BoolArray, target: FloatArray) -> BoolArray:
        """Return fewer points, a mask (N,), that still reach the targets (P,) beside those known.

        Those go first whose time gains least. Points that do not reach it are returned as they are.
        """
        kept = batch.copy()
        while np.count_nonzero(kept) > 1:
            cross, inverse = known.cross[kept], self._inverse(known, kept)
            seen = inverse @ cross
            now = known.variance - np.sum(cross * seen, axis=0)
            without = now + np.square(seen) / np.diag(inverse)[:, np.newaxis]
            enough = np.all(without <= target, axis=1)
            if not enough.any():
                break
            alone_s = self._costs.one_less_s(kept, self._dwell)[kept]
            lost = (_missed(without, target) - _missed(now, target)) / alone_s
            kept[np.flatnonzero(kept)[int(np.argmin(np.where(enough, lost, np.inf)))]] = False
        return kept

    @staticmethod
    def _inverse(known: Posterior, batch: BoolArray) -> FloatArray:
        """Inverse covariance (M, M) of the readings of the M points of a batch, a mask (N,).

        In units of their independent u, and before they are measured (Woodbury).
        """
        return np.asarray(
            np.linalg.inv(np.eye(batch.sum()) + known.predicted[np.ix_(batch, batch)])
        )

    def _target(self, ratio: Mapping[str, float]) -> FloatArray:
        """Return the squared u (P,), in units of those wanted, at which each may be reached."""
        return np.array([(MARGIN / ratio[name]) ** 2 for name in self.asked])

    def _variances(self, known: Posterior, batch: BoolArray) -> FloatArray:
        """Return the squared u (P,) of the parameters, in units of those wanted, with a batch."""
        cross = known.cross[batch]
        return np.asarray(
            known.variance - np.sum(cross * (self._inverse(known, batch) @ cross), axis=0)
        )

    def _reasons(self, known: Posterior, batch: BoolArray) -> dict[int, str]:
        """Return the parameter that each further point is for: whose variance it lowers most."""
        part = np.square(self._inverse(known, batch) @ known.cross[batch])
        part = part / self._variances(known, batch)
        return {
            int(k): self.asked[int(np.argmax(row))]
            for k, row in zip(np.flatnonzero(batch), part, strict=True)
        }

    def _spread(
        self, reasons: dict[int, str], batch: BoolArray, spread: int, allowed: BoolArray
    ) -> None:
        """Add points for lack of fit, until they are a fifth of all: the farthest from others."""
        taken, geometry = self._chosen | batch, self.every.measurements.geometry
        taken[list(reasons)] = True
        while spread < SHARE * taken.sum():
            far = farthest_from(geometry, taken, allowed)
            if far is None:
                return
            taken[far], reasons[far], spread = True, LACK_OF_FIT, spread + 1

    def _spent_s(self, batch: BoolArray) -> float:
        """Return the time of a batch, a mask (N,), with the best numbers of frames."""
        so_far, spent_s = np.zeros(batch.size, dtype=bool), 0.0
        for point in np.flatnonzero(batch):
            spent_s += float(self._costs.one_more_s(so_far, self._dwell)[point])
            so_far[point] = True
        return spent_s


def _without_drift(information: Information) -> Information:
    """Return the information without the errors of the lamp's drift, which a forecast has too many.

    It is that of all candidates, one setting of the lamp after the other, with a drift each. A scan
    goes to and fro with fewer checks; what is left of its drift is in the u of its fit.
    """
    rows, K = information.rows.copy(), len(information.names)
    drift = [name.startswith((DRIFT, WANDER)) for name in information.errors]
    rows[:, K + np.flatnonzero(drift)] = 0.0
    return replace(information, rows=rows)


def _missed(variance: FloatArray, target: FloatArray) -> FloatArray:
    """Sum (...) over parameters of their variances (..., P) in units of the targets (P,).

    Beyond its target a parameter hardly counts.
    """
    share = variance / target
    return np.asarray((np.maximum(share, 1.0) + _BEYOND * share).sum(axis=-1))


def _best_multiples(noise: FloatArray, costs: Costs) -> IntArray:
    """Frames (N,) of the points, in units of the protocol's, that teach most per second.

    noise: (N,), part p of the variance that frames average. With a way of w and frames of f
    seconds, the variance p / m + 1 - p times the time w + m f is least at m^2 = p w / ((1 - p) f)
    (Cochran 1977, section 10.6, for stages of a sample).
    """
    rest = np.maximum(1 - noise, 1e-9) * np.maximum(costs.frames_s, 1e-9)
    best = np.sqrt(noise * costs.move_s / rest)
    return np.asarray(np.clip(np.round(best), 1, MOST), dtype=np.int64)


def _worst(known: Knowledge) -> Geometry | None:
    """Return the measured geometry at which the leading model is farthest off, relative to it."""
    if known.leading is None:
        return None
    problem, predicted = known.leading.problem, known.leading.predicted
    at = int(np.argmax(np.abs(problem.brdf / predicted - 1)))
    views = (problem.geometry.theta_i_deg, problem.geometry.theta_r_deg, problem.geometry.dphi_deg)
    theta_i, theta_r, dphi = (np.ravel(view)[at : at + 1] for view in views)
    return Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
