"""Which model: the simplest that the data cannot tell from the best, or none that is adequate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.acceptance import Acceptance
from analysis.fit import UNLIKELY, FitResult, determined, first_fit, probability, refined
from analysis.measurements import Measurements
from analysis.models import MODELS
from instrument.errors import NotDetermined

# Of rising cost, which breaks ties between models with as many parameters.
LADDER = (
    "lambert",
    "oren_nayar_qualitative",
    "oren_nayar",
    "lambert+torrance_sparrow",
    "oren_nayar_qualitative+torrance_sparrow",
    "oren_nayar+torrance_sparrow",
)

# Kass and Raftery, "Bayes Factors" (1995), table: strong evidence begins at a difference of 6.
STRONG_BIC = 6.0
# Predictions that differ less than this part of u_total are the same for all that they serve.
SAME_PREDICTION = 1 / 3
# Such a simpler model may leave this many times the chi2 that the best one leaves unexplained.
SAME_CHI2 = 2.0
MOST_RMS_RELATIVE = 0.05


@dataclass(frozen=True, slots=True)
class Choice:
    """All candidates as fitted, the chosen one's name, a verdict on it, and why.

    verdict: "adequate", "none adequate" or "not identifiable" (it agrees, but has a parameter
    that the data do not determine). `chosen` is None only where no fit converged.
    """

    candidates: tuple[FitResult, ...]
    chosen: str | None
    verdict: str
    reason: str


def choose(
    measurements: Measurements,
    acceptance: Acceptance | None = None,
    models: Sequence[str] = LADDER,
) -> Choice:
    """Fit every model and choose the simplest that explains the data as well as the best does.

    A first pass with independent uncertainties finds the best smooth curve near the data; around
    it the second pass makes the covariance of all uncertainties for every candidate. Models with
    too many parameters for the points are left out. Raises `NotDetermined` when that are all of
    them, `KeyError` for an unknown model.
    """
    named = [MODELS[name] for name in models]
    first = [first_fit(model, measurements) for model in named if determined(model, measurements)]
    if not first:
        raise NotDetermined(
            f"{measurements.size} points are too few to fit any of: {', '.join(models)}"
        )
    best = min(first, key=lambda f: (not f.solution.converged, f.bic))
    candidates = tuple(refined(f, measurements, acceptance, best.brdf) for f in first)
    left_out = [m.name for m in named if not determined(m, measurements)]
    return _chosen(candidates, measurements, left_out)


def _chosen(
    candidates: tuple[FitResult, ...], measurements: Measurements, left_out: list[str]
) -> Choice:
    converged = [c for c in candidates if c.converged]
    if not converged:
        return Choice(candidates, None, "none adequate", "no fit converged")
    best = min(converged, key=lambda c: c.bic)
    tied = [c for c in converged if _as_good(c, best, measurements.size)]
    chosen = min(tied, key=lambda c: len(c.values))  # the first of them: the ladder's order
    verdict, reason = _judged(chosen, measurements)
    if chosen is not best:
        reason += f"; the data do not tell it from {best.model}, which has the best BIC"
    if left_out:
        reason += f"; left out, too few points: {', '.join(left_out)}"
    return Choice(candidates, chosen.model, verdict, reason)


def _as_good(candidate: FitResult, best: FitResult, points: int) -> bool:
    """Whether the data cannot tell a candidate from the best one."""
    return _bic_above(candidate, best, points) < STRONG_BIC or _same(candidate, best)


def _bic_above(candidate: FitResult, best: FitResult, points: int) -> float:
    """How far the BIC lies above the best one's, misfit of the best counting as noise.

    Where even the best model leaves more than the stated u explains, that unknown error is not
    evidence for any model: chi2 is scaled by the best one's reduced chi2 (Birge 1932).
    """
    if candidate.chi2 is None or best.chi2 is None:
        return candidate.bic - best.bic
    more = len(candidate.values) - len(best.values)
    birge = max(1.0, best.reduced_chi2 or 1.0)
    return (candidate.chi2 - best.chi2) / birge + more * math.log(points)


def _same(candidate: FitResult, best: FitResult) -> bool:
    """Whether two models predict the same within u_total, and explain about as much."""
    apart = np.abs(candidate.predicted - best.predicted)
    if np.any(apart >= SAME_PREDICTION * best.u_total):
        return False
    if candidate.chi2 is None or best.chi2 is None:
        return True
    return candidate.chi2 <= SAME_CHI2 * best.chi2 or _probability(candidate) > UNLIKELY


def _probability(result: FitResult) -> float:
    return 1.0 if result.chi2 is None else probability(result.chi2, result.dof)


def _judged(chosen: FitResult, measurements: Measurements) -> tuple[str, str]:
    if chosen.dof == 0:
        return "not identifiable", f"{chosen.model}: as many parameters as points, nothing to test"
    adequate, reason = _adequate(chosen)
    if not adequate:
        return "none adequate", f"{reason}; worst at {_worst(chosen, measurements)}"
    if chosen.undetermined:
        names = ", ".join(
            f"{name} (anywhere in {chosen.intervals[name][0]:.4g} to "
            f"{chosen.intervals[name][1]:.4g})"
            for name in chosen.undetermined
        )
        return "not identifiable", f"{reason}; the data do not determine {names}"
    return "adequate", reason


def _adequate(chosen: FitResult) -> tuple[bool, str]:
    if chosen.chi2 is None:
        rms = 100 * chosen.rms_relative
        words = f"{chosen.model}: rms residual {rms:.3g} % of the mean, allowed 5 % (no u stated)"
        return chosen.rms_relative <= MOST_RMS_RELATIVE, words
    probability = _probability(chosen)
    words = (
        f"{chosen.model}: chi2 {chosen.chi2:.4g} for {chosen.dof} degrees of freedom, "
        f"p = {probability:.2g} (rejected below {UNLIKELY:g})"
    )
    return probability > UNLIKELY, words


def _worst(chosen: FitResult, m: Measurements, count: int = 3) -> str:
    order = np.argsort(-np.abs(chosen.residuals))[:count]
    return ", ".join(
        f"theta_i {m.theta_i_deg[i]:g}, theta_r {m.theta_r_deg[i]:g}, dphi {m.dphi_deg[i]:g} "
        f"degrees ({chosen.residuals[i]:+.1f} u)"
        for i in order
    )


def to_json(choice: Choice) -> dict[str, Any]:
    """The choice as `fit.json` holds it: for `json.dumps(..., allow_nan=False)`."""
    return {
        "chosen": choice.chosen,
        "verdict": choice.verdict,
        "candidates": [_candidate(c) for c in choice.candidates],
    }


def _candidate(result: FitResult) -> dict[str, Any]:
    return {
        "model": result.model,
        "parameters": {name: _parameter(result, name) for name in result.values},
        "rms_relative": _number(result.rms_relative),
        "reduced_chi2": _number(result.reduced_chi2),
        "bic": _number(result.bic),
        "converged": result.converged,
    }


def _parameter(result: FitResult, name: str) -> dict[str, Any]:
    entry: dict[str, Any] = {"value": _number(result.values[name]), "u": _number(result.u[name])}
    if name in result.intervals:
        entry["interval"] = [_number(end) for end in result.intervals[name]]
    return entry


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
