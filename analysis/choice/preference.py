"""Preference among fitted candidates: the simplest on which no larger one improves enough."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from analysis.choice.cross_validation import FEW, folds, held_out_error
from analysis.choice.ladder import SAME_PREDICTION, physics
from analysis.data.measurements import Measurements
from analysis.fit.criteria import SIGNIFICANCE, probability
from analysis.fit.fit import FitResult
from instrument.geometry import BoolArray

# Kass and Raftery, "Bayes Factors", 1995: a difference of BIC up to 2 is "not worth more than a
# bare mention"; one above 6 is "strong" evidence. Further parameters need it: many models that have
# some are tried.
TIE_BIC, STRONG_BIC = 2.0, 6.0
# Ratio of chi2 up to which a cheaper method with the same predictions is preferred.
SAME_CHI2 = 2.0
# Errors of prediction that differ by no more than this factor are computed with all points.
_NEARLY_EQUAL = 1.03


def simplest(converged: Iterable[FitResult], measurements: Measurements) -> FitResult:
    """The simplest candidate on which no larger or costlier one improves enough.

    Beside the evidence of BIC, what a candidate predicts worse, held out of the fit, must be less
    than what it fits better: as ratios of residuals.
    """
    current, *larger = sorted(converged, key=lambda c: c.x.size)  # stable: the ladder's order
    best = min((current, *larger), key=lambda c: c.bic)
    predictions = _Predictions(measurements, folds(measurements) if larger else [])
    for candidate in larger:
        evidence = _bic_difference(current, candidate, best, measurements.size)
        needed = STRONG_BIC if candidate.x.size > current.x.size else TIE_BIC
        if evidence <= needed or _equivalent(current, candidate):
            continue
        if not predictions.left_out or predictions.better(candidate, current):
            current = candidate
    return current


@dataclass(frozen=True, slots=True)
class _Predictions:
    """Errors of the candidates' predictions of points left out of the fit, each computed once.

    left_out: masks (N,) of `folds`. known: by name of the model and the most points of a fit.
    """

    measurements: Measurements
    left_out: list[BoolArray]
    known: dict[tuple[str, int | None], float] = field(default_factory=dict)

    def better(self, candidate: FitResult, current: FitResult) -> bool:
        """True if one predicts and fits better than another: as the product of its residuals."""
        ratio = self._ratio(candidate, current, FEW)
        if 1 / _NEARLY_EQUAL < ratio < _NEARLY_EQUAL and self.measurements.size > FEW:
            ratio = self._ratio(candidate, current, None)
        return ratio < 1.0

    def _ratio(self, candidate: FitResult, current: FitResult, most: int | None) -> float:
        own, other = (self._error(one, most) * _misfit(one) for one in (candidate, current))
        return own / other if other else math.inf

    def _error(self, candidate: FitResult, most: int | None) -> float:
        key = candidate.model, most
        if key not in self.known:
            self.known[key] = held_out_error(
                self.measurements, candidate.problem, candidate.x, self.left_out, most
            )
        return self.known[key]


def _misfit(result: FitResult) -> float:
    """Size of the residuals, in a unit that the candidates share."""
    return result.rms_relative if result.chi2 is None else math.sqrt(result.chi2)


def _bic_difference(candidate: FitResult, other: FitResult, best: FitResult, points: int) -> float:
    """BIC of a candidate minus that of another, with the misfit of the best counted as noise.

    Where even the best model does not agree within the stated u, the unknown error is no evidence
    for any model: chi2 is scaled by the best one's reduced chi2 (Birge 1932).
    """
    if candidate.chi2 is None or other.chi2 is None:
        return candidate.bic - other.bic
    more = candidate.x.size - other.x.size
    loss = candidate.bic - other.bic - more * math.log(points)
    return loss / max(1.0, best.reduced_chi2 or 1.0) + more * math.log(points)


def _equivalent(cheaper: FitResult, other: FitResult) -> bool:
    """True for methods of one physics with the same predictions within u/3 and a similar chi2."""
    if physics(cheaper.model) != physics(other.model):
        return False
    if np.any(np.abs(cheaper.predicted - other.predicted) >= SAME_PREDICTION * other.u_total):
        return False
    if cheaper.chi2 is None or other.chi2 is None:
        return True
    return cheaper.chi2 <= SAME_CHI2 * other.chi2 or _probability(cheaper) > SIGNIFICANCE


def _probability(result: FitResult) -> float:
    return 1.0 if result.chi2 is None else probability(result.chi2, result.dof)
