"""Models that could pass for the leading one, and the candidates that tell them from it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from acquisition.adaptive.knowledge import Knowledge
from acquisition.design.forecast import Forecast
from analysis.choice.ladder import physics
from analysis.design.rivals import MOST, Rival
from analysis.fit.fit import FitResult
from instrument.geometry import BoolArray, FloatArray

CONTESTED = 4
"""Points of a batch that tell models apart where another than the leading one is chosen."""

_TOLD = 100.0  # chi2, to first order, beyond which a point more need not tell two models apart


def rivals_of(known: Knowledge, every: Forecast) -> Iterator[Rival]:
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


def telling_apart(
    rivals: Sequence[Rival], design: BoolArray, free: BoolArray, seconds: FloatArray, most: int
) -> list[int]:
    """Return up to `most` of the free candidates, a mask (N,), that tell the closest rivals best.

    By what they add to a rival's chi2, in units of u^2, in each of the `seconds` (N,) that they
    take; none where the design, a mask (N,), tells all rivals apart.
    """
    taken, found = design.copy(), list[int]()
    while len(found) < most and np.any(free & ~taken):
        worth = _told_by(rivals, taken)
        if worth is None:
            break
        found.append(int(np.argmax(np.where(free & ~taken, worth / seconds, -1.0))))
        taken[found[-1]] = True
    return found


def _told_by(rivals: Sequence[Rival], design: BoolArray) -> FloatArray | None:
    """Return the chi2 (N,) that each candidate adds to the first rival that is not told apart.

    None where the design, a mask (N,), tells all apart.
    """
    for rival in rivals:
        best = rival.best(design)
        if best.chi2 < _TOLD:
            return rival.differences(design, best)
    return None
