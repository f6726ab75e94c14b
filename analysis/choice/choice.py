"""Choice of the simplest model that explains the data as well as the best, or of none.

Each further parameter must improve Schwarz's criterion (BIC), and the prediction of incidences or
blocks of view angles held out of the fit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.choice.candidates import Candidates
from analysis.choice.cross_validation import folds, held_out_error
from analysis.choice.ladder import LADDER, RICH, SAME_PREDICTION, MethodOfFit, physics, with_method
from analysis.choice.light import require_light
from analysis.choice.runs_test import runs_probability, worst_stretches
from analysis.choice.symmetry_test import Symmetry, p_text, symmetry
from analysis.data.acceptance import Acceptance
from analysis.data.measurements import Measurements
from analysis.fit.criteria import LEAST_NOISE, SIGNIFICANCE, probability
from analysis.fit.fit import FitResult
from instrument.geometry import FloatArray

# A smaller difference of BIC is no evidence (Kass and Raftery, "Bayes Factors", 1995: "not worth
# more than a bare mention").
TIE_BIC = 2.0
# Ratio of chi2 up to which a cheaper method with the same predictions is preferred.
SAME_CHI2 = 2.0
MAX_RMS_RELATIVE = 0.05
# A smaller reduced chi2 shows that the stated u includes errors that points share. Residuals of one
# sign in a row are then expected.
_SHARED_U_CHI2 = 0.5


@dataclass(frozen=True, slots=True)
class Choice:
    """All fitted candidates, the name of the chosen one, the verdict on it, and its reason.

    verdict: "adequate", "none adequate" or "not identifiable" (it agrees, but has a parameter
    that the data do not determine). `chosen` is None only where no fit converged. symmetry: test
    of Wolff, Nayar and Oren (1998), section 3.1; None where no model is chosen.
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

    Without `models`, the candidates are LADDER and, where these do not explain the data, also RICH;
    an integrated model whose functional form is as accurate is then left out, unless a `method` for
    the rough surface is requested. Models with too many parameters for the points are left out.
    Raises `NotDetermined` when the points are too few for all of them or show no light, `KeyError`
    for an unknown model.
    """
    require_light(measurements)
    names = with_method(models or LADDER, method)
    candidates = Candidates.of(names, measurements, robust, every=models is not None)
    choice = _chosen(candidates, acceptance)
    if models is not None or _explained(choice):
        return choice
    return _chosen(candidates.with_more(with_method(RICH, method)), acceptance)


def _explained(choice: Choice) -> bool:
    """True if the chosen model agrees within the stated u, or to rounding where none is stated."""
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
    verdict, reason = _verdict(chosen, measurements)
    if chosen is not best:
        reason += f"; {best.model} has the lowest BIC, but improves too little to be preferred"
    if tried.left_out:
        reason += f"; left out for lack of points: {', '.join(tried.left_out)}"
    noise = max(chosen.rms_relative, LEAST_NOISE) * float(np.mean(measurements.brdf))
    tested = symmetry(measurements, chosen.brdf, noise)
    return Choice(candidates, chosen.model, verdict, reason, tested)


def _simplest(
    converged: Iterable[FitResult], best: FitResult, measurements: Measurements
) -> FitResult:
    """The simplest candidate on which no larger or costlier one improves enough."""
    left_out = folds(measurements)
    scores: dict[str, float] = {}

    def score(candidate: FitResult) -> float:
        if candidate.model not in scores:
            scores[candidate.model] = held_out_error(
                measurements, candidate.problem, candidate.x, left_out
            )
        return scores[candidate.model]

    current, *larger = sorted(converged, key=lambda c: c.x.size)  # stable: the ladder's order
    for candidate in larger:
        better = _bic_difference(current, candidate, best, measurements.size) > TIE_BIC
        if not better or _equivalent(current, candidate):
            continue
        if not left_out or score(candidate) < score(current):
            current = candidate
    return current


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


def _verdict(chosen: FitResult, measurements: Measurements) -> tuple[str, str]:
    if chosen.dof <= 0:
        return "not identifiable", f"{chosen.model}: as many parameters as points, no test possible"
    adequate, reason = _adequate(chosen, measurements)
    if not adequate:
        worst = worst_stretches(measurements, _without_outliers(chosen))
        return "none adequate", f"{reason}; worst at {'; '.join(map(str, worst))}"
    if chosen.undetermined:
        names = ", ".join(
            f"{name} (anywhere in {chosen.intervals[name][0]:.4g} to "
            f"{chosen.intervals[name][1]:.4g})"
            for name in chosen.undetermined
        )
        return "not identifiable", f"{reason}; the data do not determine {names}"
    return "adequate", reason


def _adequate(chosen: FitResult, measurements: Measurements) -> tuple[bool, str]:
    outliers = int(np.sum(chosen.outliers))
    set_aside = f", {outliers} outliers set aside" if outliers else ""
    if chosen.chi2 is None:
        rms = 100 * chosen.rms_relative
        text = f"{chosen.model}: rms residual {rms:.3g} % of the mean, allowed 5 % (no u stated)"
        return chosen.rms_relative <= MAX_RMS_RELATIVE, text + set_aside
    by_chi2 = _probability(chosen)
    by_runs = runs_probability(measurements, _without_outliers(chosen))
    text = (
        f"{chosen.model}: chi2 {chosen.chi2:.4g} for {chosen.dof} degrees of freedom, "
        f"{p_text(by_chi2)}; runs test of the residuals' signs, {p_text(by_runs)} "
        f"(rejected below {SIGNIFICANCE:g})"
    )
    if chosen.chi2 < _SHARED_U_CHI2 * chosen.dof:
        text += "; the stated u exceeds the scatter of the points, so the runs test is ignored"
        by_runs = 1.0
    return min(by_chi2, by_runs) > SIGNIFICANCE, text + set_aside


def _without_outliers(result: FitResult) -> FloatArray:
    """Residuals (N,) in units of u, 0 at outliers, which thereby belong to no run of one sign."""
    return np.where(result.outliers, 0.0, result.residuals)
