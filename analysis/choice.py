"""Which model: the simplest that the data cannot tell from the best, or none that is adequate.

A larger model has to earn its parameters twice: by Schwarz's criterion (BIC), and by foretelling
incidences or blocks of view angle that were left out of its fit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.acceptance import Acceptance
from analysis.first_fit import FirstFit, deepened, determined, quick_fit
from analysis.fit import FitResult, refined
from analysis.held_out import folds, held_out
from analysis.ladder import LADDER, approximation, physics
from analysis.likelihood import LEAST_NOISE, UNLIKELY, probability
from analysis.measurements import Measurements
from analysis.models import MODELS
from analysis.models.departure import departure
from analysis.relative import NAME as RELATIVE_FACTOR
from analysis.relative import levelled
from analysis.structure import failures, runs_probability
from analysis.symmetry import Symmetry, p_text, symmetry
from instrument.errors import NotDetermined
from instrument.geometry import FloatArray

# A larger BIC by less than this is no evidence (Kass and Raftery, "Bayes Factors", 1995: "not
# worth more than a bare mention").
TIE_BIC = 2.0
# Predictions that differ less than this part of u are the same for all that they serve.
SAME_PREDICTION = 1 / 3
# Such a cheaper method may leave this many times the chi2 that the better one leaves.
SAME_CHI2 = 2.0
MOST_RMS_RELATIVE = 0.05
# Below this reduced chi2 the stated u is not the points' own scatter, but holds errors that they
# share: what they then leave in a row is inside u.
_NOT_SCATTER = 0.5
# A first fit with so many times the best one's chi2 is not made better by averaging over the rig.
_HOPELESS = 25.0


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
) -> Choice:
    """Fit every model and choose the simplest that explains the data as well as the best does.

    A first pass with independent uncertainties finds the best smooth curve near the data; around
    it the second pass makes the covariance of all uncertainties for every candidate. Models with
    too many parameters for the points are left out; without `models`, which are then those of the
    ladder, so is an integrated one whose functional form is as good. Raises `NotDetermined` when
    too few points leave none of them, `KeyError` for an unknown model.
    """
    named = [MODELS[name] for name in models or LADDER]
    possible = [model.name for model in named if determined(model, measurements)]
    if not possible:
        names = ", ".join(model.name for model in named)
        raise NotDetermined(f"{measurements.size} points are too few to fit any of: {names}")
    first = _first_fits(possible, measurements, robust, every=models is not None)
    if measurements.free_levels:
        measurements = levelled(measurements, _best(first).brdf)
        first = _first_fits(possible, measurements, robust, every=models is not None)
    best = _best(first)
    candidates = tuple(
        refined(f, measurements, acceptance, best.brdf, _hopeless(f, best, measurements))
        for f in first
    )
    return _chosen(candidates, measurements, [m.name for m in named if m.name not in possible])


def _best(first: Iterable[FirstFit]) -> FirstFit:
    return min(first, key=lambda f: (not f.solution.converged, f.bic))


def _first_fits(
    names: Sequence[str], measurements: Measurements, robust: bool, every: bool
) -> list[FirstFit]:
    """First fits in the order of the names; an integrated model where it may differ, or `every`.

    Further basins of a model are looked into unless it is hopeless in the first one.
    """
    quick: dict[str, FirstFit] = {}
    for name in names:
        form = quick.get(approximation(name) or "")
        if every or form is None or _leaves_integral(form, measurements):
            quick[name] = quick_fit(MODELS[name], measurements)
    best = _best(quick.values())
    return [
        f if _hopeless(f, best, measurements) else deepened(f, measurements, robust)
        for f in quick.values()
    ]


def _leaves_integral(form: FirstFit, measurements: Measurements) -> bool:
    """Whether the functional form, as fitted, is off the integral by more than u/3 anywhere."""
    names = [p.name for p in form.problem.model.parameters]
    values = dict(zip(names, map(float, form.solution.x), strict=True))
    geometry, albedo, sigma = measurements.geometry, values["albedo"], values["sigma_deg"]
    rough = MODELS["oren_nayar"].brdf(geometry, albedo=albedo, sigma_deg=sigma)
    rough *= values.get(RELATIVE_FACTOR, 1.0)
    off = np.abs(rough * departure("oren_nayar", geometry, albedo, sigma))
    u = measurements.u_random
    if u is None:
        left = form.problem.predict(form.solution.x) - measurements.brdf
        u = np.full(measurements.size, float(np.sqrt(np.mean(np.square(left)))))
    return bool(np.any(off > SAME_PREDICTION * u))


def _hopeless(fit: FirstFit, best: FirstFit, m: Measurements) -> bool:
    """Whether neither averaging over the rig nor another basin can bring a model near the best."""
    enough = 0.0 if m.u_random is None else float(m.size)
    return fit.solution.chi2 > _HOPELESS * max(best.solution.chi2, enough)


def _chosen(
    candidates: tuple[FitResult, ...], measurements: Measurements, left_out: list[str]
) -> Choice:
    converged = [c for c in candidates if c.converged]
    if not converged:
        return Choice(candidates, None, "none adequate", "no fit converged")
    best = min(converged, key=lambda c: c.bic)
    chosen = _simplest(converged, best, measurements)
    verdict, reason = _judged(chosen, measurements)
    if chosen is not best:
        reason += f"; {best.model}, which has the best BIC, does not earn what it costs"
    if left_out:
        reason += f"; left out, too few points: {', '.join(left_out)}"
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
            scores[candidate.model] = held_out(candidate.problem, candidate.x, left_out)
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
