"""Which model: the simplest that the data cannot tell from the best, or none that is adequate.

A larger model has to earn its parameters twice: by Schwarz's criterion (BIC), and by foretelling
incidences or blocks of view angle that were left out of its fit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.choice.candidates import Candidates
from analysis.choice.cross_validation import folds, held_out
from analysis.choice.ladder import LADDER, RICH, SAME_PREDICTION, MethodOfFit, of_method, physics
from analysis.choice.runs_test import failures, runs_probability
from analysis.choice.symmetry_test import Symmetry, p_text, symmetry
from analysis.data.acceptance import Acceptance
from analysis.data.measurements import Measurements
from analysis.fit.criteria import LEAST_NOISE, UNLIKELY, probability
from analysis.fit.fit import FitResult
from instrument.geometry import FloatArray

# A larger BIC by less than this is no evidence (Kass and Raftery, "Bayes Factors", 1995: "not
# worth more than a bare mention").
TIE_BIC = 2.0
# Such a cheaper method may leave this many times the chi2 that the better one leaves.
SAME_CHI2 = 2.0
MOST_RMS_RELATIVE = 0.05
# Below this reduced chi2 the stated u is not the points' own scatter, but holds errors that they
# share: what they then leave in a row is inside u.
_NOT_SCATTER = 0.5


@dataclass(frozen=True, slots=True)
class Choice:
    """All candidates as fitted, the chosen one's name, a verdict on it, and why.

    verdict: "adequate", "none adequate" or "not identifiable" (it agrees, but has a parameter
    that the data do not determine). `chosen` is None only where no fit converged. symmetry: the
    test of 1998, section 3.1, None where nothing is chosen.
    """

    candidates: tuple[FitResult, ...]
    chosen: str | None
    verdict: str
    reason: str
    symmetry: Symmetry | None = None


def choose(
    measurements: Measurements,
    acceptance: Acceptance | None = None,
    models: Sequence[str] | None = None,
    robust: bool = False,
    method: MethodOfFit = "auto",
) -> Choice:
    """Fit every model and choose the simplest that explains the data as well as the best does.

    Without `models` they are those of the ladder, and where these do not explain the data the rich
    ones too; an integrated model whose functional form is as good is then left out, unless a
    `method` for the rough surface is asked for. Models with too many parameters for the points are
    left out. Raises `NotDetermined` when too few points leave none of them, `KeyError` for an
    unknown model.
    """
    names = of_method(models or LADDER, method)
    candidates = Candidates.of(names, measurements, robust, every=models is not None)
    choice = _chosen(candidates, acceptance)
    if models is not None or _explained(choice):
        return choice
    return _chosen(candidates.with_more(of_method(RICH, method)), acceptance)


def _explained(choice: Choice) -> bool:
    """Whether nothing is left for a larger model: no more than the stated u, or than rounding."""
    chosen = next((c for c in choice.candidates if c.model == choice.chosen), None)
    if chosen is None or chosen.chi2 is not None:
        return chosen is not None and choice.verdict != "none adequate"
    return chosen.rms_relative <= LEAST_NOISE


def _chosen(tried: Candidates, acceptance: Acceptance | None) -> Choice:
    candidates, measurements = tried.refined(acceptance), tried.measurements
    converged = [c for c in candidates if c.converged]
    if not converged:
        return Choice(candidates, None, "none adequate", "no fit converged")
    best = min(converged, key=lambda c: c.bic)
    chosen = _simplest(converged, best, measurements)
    verdict, reason = _judged(chosen, measurements)
    if chosen is not best:
        reason += f"; {best.model}, which has the best BIC, does not earn what it costs"
    if tried.left_out:
        reason += f"; left out, too few points: {', '.join(tried.left_out)}"
    noise = max(chosen.rms_relative, LEAST_NOISE) * float(np.mean(measurements.brdf))
    tested = symmetry(measurements, chosen.brdf, noise)
    return Choice(candidates, chosen.model, verdict, reason, tested)


def _simplest(
    converged: Iterable[FitResult], best: FitResult, measurements: Measurements
) -> FitResult:
    """The last of the candidates, by rising number of parameters and cost, that earns its place."""
    left_out = folds(measurements)
    scores: dict[str, float] = {}

    def score(candidate: FitResult) -> float:
        if candidate.model not in scores:
            scores[candidate.model] = held_out(
                measurements, candidate.problem, candidate.x, left_out
            )
        return scores[candidate.model]

    current, *larger = sorted(converged, key=lambda c: c.x.size)  # stable: the ladder's order
    for candidate in larger:
        better = _bic_above(current, candidate, best, measurements.size) > TIE_BIC
        if not better or _same(current, candidate):
            continue
        if not left_out or score(candidate) < score(current):
            current = candidate
    return current


def _bic_above(candidate: FitResult, other: FitResult, best: FitResult, points: int) -> float:
    """How far a candidate's BIC lies above another's, misfit of the best counting as noise.

    Where even the best model leaves more than the stated u explains, that unknown error is not
    evidence for any model: chi2 is scaled by the best one's reduced chi2 (Birge 1932).
    """
    if candidate.chi2 is None or other.chi2 is None:
        return candidate.bic - other.bic
    more = candidate.x.size - other.x.size
    loss = candidate.bic - other.bic - more * math.log(points)
    return loss / max(1.0, best.reduced_chi2 or 1.0) + more * math.log(points)


def _same(cheaper: FitResult, other: FitResult) -> bool:
    """Whether two methods for one physics predict the same within u, and explain about as much."""
    if physics(cheaper.model) != physics(other.model):
        return False
    if np.any(np.abs(cheaper.predicted - other.predicted) >= SAME_PREDICTION * other.u_total):
        return False
    if cheaper.chi2 is None or other.chi2 is None:
        return True
    return cheaper.chi2 <= SAME_CHI2 * other.chi2 or _probability(cheaper) > UNLIKELY


def _probability(result: FitResult) -> float:
    return 1.0 if result.chi2 is None else probability(result.chi2, result.dof)


def _judged(chosen: FitResult, measurements: Measurements) -> tuple[str, str]:
    if chosen.dof <= 0:
        return "not identifiable", f"{chosen.model}: as many parameters as points, nothing to test"
    adequate, reason = _adequate(chosen, measurements)
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


def _adequate(chosen: FitResult, measurements: Measurements) -> tuple[bool, str]:
    aside = int(np.sum(chosen.outliers))
    set_aside = f", {aside} outliers set aside" if aside else ""
    if chosen.chi2 is None:
        rms = 100 * chosen.rms_relative
        words = f"{chosen.model}: rms residual {rms:.3g} % of the mean, allowed 5 % (no u stated)"
        return chosen.rms_relative <= MOST_RMS_RELATIVE, words + set_aside
    by_chi2, by_runs = _probability(chosen), runs_probability(measurements, _kept(chosen))
    words = (
        f"{chosen.model}: chi2 {chosen.chi2:.4g} for {chosen.dof} degrees of freedom, "
        f"{p_text(by_chi2)}; runs of residuals of one sign, {p_text(by_runs)} "
        f"(rejected below {UNLIKELY:g})"
    )
    if chosen.chi2 < _NOT_SCATTER * chosen.dof:
        words += "; the stated u is more than the points scatter, so runs do not count"
        by_runs = 1.0
    return min(by_chi2, by_runs) > UNLIKELY, words + set_aside


def _kept(result: FitResult) -> FloatArray:
    """Residuals, 0 for the points that are set aside: a run has no sign there."""
    return np.where(result.outliers, 0.0, result.residuals)


def _worst(chosen: FitResult, measurements: Measurements) -> str:
    return "; ".join(map(str, failures(measurements, _kept(chosen))))
