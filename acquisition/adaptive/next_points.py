"""Next points of an adaptive scan: those that teach most in each second of bench time.

Of each batch one point at least is for lack of fit, the farthest from all before it; one may tell
the leading models apart; the others lower the u of the parameters asked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from acquisition.adaptive.aims import MARGIN, Aims
from acquisition.adaptive.knowledge import Knowledge
from acquisition.design.forecast import Forecast
from analysis.choice.ladder import physics
from analysis.design.optimal import LACK_OF_FIT, RIVALS
from analysis.design.posterior import Posterior
from analysis.design.rivals import MOST, Rival
from analysis.design.space_filling import farthest_from
from analysis.fit.fit import FitResult
from instrument.geometry import BoolArray, FloatArray, IntArray

_TOLD = 100.0  # chi2, to first order, beyond which a point more need not tell two models apart
_LEAST = 2  # points of a batch, even where fewer may reach the goal


@dataclass(frozen=True, slots=True, kw_only=True)
class Costs:
    """Bench time of N candidates: its own point_s (N,), and way_s (M,) to each lamp setting.

    setting: (N,), number of each candidate's setting; here: the one at which the lamp stands.
    """

    point_s: FloatArray
    way_s: FloatArray
    setting: IntArray

    def one_more_s(self, batch: BoolArray) -> FloatArray:
        """Return the time (N,) in s that each candidate would add to a batch, a mask (N,)."""
        way_s = self.way_s.copy()
        way_s[self.setting[batch]] = 0.0
        return np.asarray(self.point_s + way_s[self.setting])


class NextPoints:
    """Choice among the N candidates of a forecast for the leading model, given those chosen."""

    def __init__(
        self, every: Forecast, costs: Costs, chosen: BoolArray, known: Knowledge, aims: Aims
    ) -> None:
        self.every, self._costs, self._aims = every, costs, aims
        self._information = every.information
        self._weights = self._information.weights(aims.u, aims.u)
        self._chosen = chosen
        self._rivals = list(_rivals(known, every))
        self.asked = [n for n in self._information.names if n in aims.u]

    def u(self, design: BoolArray) -> dict[str, float]:
        """Return the u, in its unit, of each parameter asked for by a design, a mask (N,)."""
        found = self._information.u(design.astype(np.float64))
        return {name: found[name] for name in self.asked}

    def pick(
        self, size: int, allowed: BoolArray, scale: Mapping[str, float]
    ) -> tuple[list[tuple[int, str]], float]:
        """Return up to `size` candidates, of those allowed (N,), each with its reason.

        And the decrease of the sum of squared u, in units of those wanted, per second. scale:
        factor on the forecast u of each parameter; where they reach the goal, the batch ends.
        """
        posterior = Posterior(self._information, self._weights, self._chosen)
        batch, found, spent_s, before = np.zeros(allowed.size, bool), [], 0.0, posterior.criterion
        for point, reason in self._picks(size, allowed, posterior, batch):
            spent_s += float(self._costs.one_more_s(batch)[point])
            batch[point] = True
            posterior.add(point)
            found.append((point, reason))
            if len(found) >= _LEAST and self._enough(posterior, scale):
                break
        gained = max(before - posterior.criterion, 0.0)
        return found, gained / spent_s if spent_s > 0 else 0.0

    def _picks(
        self, size: int, allowed: BoolArray, posterior: Posterior, batch: BoolArray
    ) -> Iterator[tuple[int, str]]:
        """Yield candidates; each is in the posterior and in the batch when the next is asked."""
        spread = farthest_from(self.every.measurements.geometry, self._chosen, allowed)
        if spread is None:
            return
        yield spread, LACK_OF_FIT
        apart = self._telling(allowed & ~posterior.chosen, batch) if size > _LEAST else None
        if apart is not None:
            yield apart, RIVALS
        for _ in range(size - 1 - (apart is not None)):
            free = allowed & ~posterior.chosen
            if not free.any():
                return
            gain = (posterior.criterion - posterior.with_one_more()) / self._costs.one_more_s(batch)
            best = int(np.argmax(np.where(free, gain, -np.inf)))
            yield best, self._reason(posterior, best)

    def _reason(self, posterior: Posterior, point: int) -> str:
        """Return the parameter whose variance a candidate lowers most, as a part of it."""
        part = np.square(posterior.cross[point]) / posterior.variance
        return self.asked[int(np.argmax(part))]

    def _enough(self, posterior: Posterior, scale: Mapping[str, float]) -> bool:
        u = dict(zip(self.asked, np.sqrt(posterior.variance).tolist(), strict=True))
        return all(scale[name] * u[name] <= MARGIN for name in self.asked)

    def _telling(self, free: BoolArray, batch: BoolArray) -> int | None:
        """Return the candidate that tells the closest rival best; None where all are told apart."""
        if not free.any():
            return None
        seconds = self._costs.one_more_s(batch)
        for rival in self._rivals:
            if rival.missed(self._chosen) < _TOLD:
                worth = np.where(free, rival.differences(self._chosen) / seconds, -1.0)
                return int(np.argmax(worth))
        return None


def _rivals(known: Knowledge, every: Forecast) -> Iterator[Rival]:
    """Yield the other candidates that describe the readings best, those of other physics."""
    if known.choice is None or known.leading is None or every.measurements.relative:
        return  # relative values: the forecast's factor is not that of the rival's fit
    own, seen = known.leading, {physics(known.leading.model)}
    others = sorted((c for c in known.choice.candidates if c.converged), key=lambda c: c.bic)
    for other in others:
        if len(seen) > MOST:
            return
        if physics(other.model) not in seen and not _contains(other, own):
            seen.add(physics(other.model))
            problem = replace(every.problem, model=other.problem.model)
            yield Rival(name=other.model, problem=problem, x=other.x, chi2=0.0)


def _contains(other: FitResult, own: FitResult) -> bool:
    """Return True for a sum with all terms of the leading model: it agrees wherever that does."""
    return set(physics(own.model).split("+")) < set(physics(other.model).split("+"))
