"""Choice of the simplest model that explains the data as well as the best, or of none.

Candidates are tried in rungs by their number of parameters, up to the one after the first rung that
explains the data. Within what was tried, each further parameter must improve Schwarz's criterion
(BIC), and the prediction of incidences or blocks of view angles held out of the fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.choice.adequacy import Agreement, agreement, without_outliers
from analysis.choice.candidates import Candidates
from analysis.choice.checks.all_checks import check_notes, free_check_notes
from analysis.choice.ladder import CANDIDATES, MethodOfFit, rungs, with_method
from analysis.choice.light import require_light
from analysis.choice.notes import Note, certificate_note, fit_notes
from analysis.choice.preference import simplest
from analysis.choice.runs_test import worst_stretches
from analysis.choice.symmetry_test import Symmetry, symmetry
from analysis.data.acceptance import Acceptance
from analysis.data.measurements import Measurements
from analysis.fit.acceptance_average import is_averaged
from analysis.fit.certificate import led_by_certificate
from analysis.fit.criteria import LEAST_NOISE
from analysis.fit.first_fit import LEFT
from analysis.fit.fit import FitResult, with_linear_u
from analysis.models import MODELS

# Largest number of parameters of the models that are tried together where the lamp's levels are
# unknown: the best of them gives the levels.
_SIZE_FOR_LEVELS = 3


# Larger models are tried only where no smaller one explains the data.
_MOST_PARAMETERS_AHEAD = 3


@dataclass(frozen=True, slots=True)
class Choice:
    """All fitted candidates, the name of the chosen one, the verdict on it, and its reason.

    verdict: "adequate", "none adequate" or "not identifiable" (it agrees, but has a parameter
    that the data do not determine). `chosen` is None only where no fit converged. agreeing: names
    of the candidates that agree with the data. Only the chosen candidate has intervals, and one
    that does not agree has no u. u_scale: factor on the stated u with which the chosen one agrees.
    symmetry: test of Wolff, Nayar and Oren (1998), section 3.1; None where no model is chosen.
    """

    candidates: tuple[FitResult, ...]
    chosen: str | None
    verdict: str
    reason: str
    symmetry: Symmetry | None = None
    agreeing: frozenset[str] = frozenset()
    u_scale: float | None = None
    notes: tuple[Note, ...] = ()

    @property
    def best(self) -> FitResult | None:
        """The chosen candidate, None if there is none."""
        return next((c for c in self.candidates if c.model == self.chosen), None)


def choose(
    measurements: Measurements,
    acceptance: Acceptance | None = None,
    models: Sequence[str] | None = None,
    robust: bool = False,
    method: MethodOfFit = "auto",
    certificate_leads: bool = False,
) -> Choice:
    """Fit every model and choose the simplest that explains the data as well as the best does.

    Without `models`, the candidates are those of the ladder, up to the first rung that explains the
    data and, within the models of up to three parameters, the next one, which may be right; an
    integrated model whose functional form is as accurate is then left out, unless a `method` for
    the rough surface is requested. Of more than 4000 points one that is far behind on a part of
    them is not fitted to all, if with all points it is far behind as well. Models with too many
    parameters for the points are left out.
    `certificate_leads`: the chosen model's parameters are those at the scale of the certificate,
    which the model's form may else correct (`analysis.fit.certificate`).
    Raises `NotDetermined` when the points are too few for all of them or show no light, `KeyError`
    for an unknown model.
    """
    require_light(measurements)
    first, *others = ladder = _rungs(measurements, models, method)
    every = models is not None
    if every or robust or measurements.free_levels:
        ladder = []
    averaged = is_averaged(measurements, acceptance)
    tried = Candidates.of(first, measurements, robust, every, ladder, averaged)
    fitted = _Fitted.of(tried.refined(acceptance), tried.measurements)
    for rung in others:
        explained = bool(fitted.within_u)
        if explained and len(MODELS[rung[0]].parameters) > _MOST_PARAMETERS_AHEAD:
            break
        tried = tried.with_more(rung)
        fitted = fitted.with_new(tried, acceptance)
        if explained:
            break
    tried = tried.checked(fitted.results)
    return _chosen(tried, fitted.with_new(tried, acceptance), acceptance, certificate_leads)


def _rungs(
    m: Measurements, models: Sequence[str] | None, method: MethodOfFit
) -> list[tuple[str, ...]]:
    """Sets of candidates to try one after the other; those that were asked for at once."""
    if models is not None:
        return [with_method(models, method)]
    found = rungs(with_method(CANDIDATES, method))
    if m.free_levels:
        together = found[:_SIZE_FOR_LEVELS]
        found = [tuple(name for rung in together for name in rung), *found[_SIZE_FOR_LEVELS:]]
    return found


@dataclass(frozen=True, slots=True)
class _Fitted:
    """Fitted candidates and their agreement with the data, by name."""

    results: tuple[FitResult, ...]
    agreements: Mapping[str, Agreement]

    @classmethod
    def of(cls, results: tuple[FitResult, ...], m: Measurements) -> _Fitted:
        """Judge each result."""
        return cls(results, {c.model: agreement(c, m) for c in results})

    def with_new(self, tried: Candidates, acceptance: Acceptance | None) -> _Fitted:
        """All results, with those that are new or were rough before."""
        rough = {f.model.name for f in tried.first if f.rough}
        known = {c.model: c for c in self.results if c.message != LEFT or c.model in rough}
        new = _Fitted.of(tried.refined(acceptance, known), tried.measurements)
        known |= {c.model: c for c in new.results}
        results = tuple(known[f.model.name] for f in tried.first)
        return _Fitted(results, {**self.agreements, **new.agreements})

    @property
    def within_u(self) -> list[FitResult]:
        """Candidates that agree within the stated u, or to rounding where none is stated."""
        return [c for c in self.results if self.agreements[c.model].within_u]

    @property
    def eligible(self) -> list[FitResult]:
        """Candidates within u; if there are none, those that agree; else all that converged."""
        agreeing = [c for c in self.results if self.agreements[c.model].agrees]
        return self.within_u or agreeing or [c for c in self.results if c.converged]


def _chosen(
    tried: Candidates, fitted: _Fitted, acceptance: Acceptance | None, certificate_leads: bool
) -> Choice:
    m, eligible = tried.measurements, fitted.eligible
    if not eligible:
        notes, reason = free_check_notes(m), "no fit converged"
        return Choice(fitted.results, None, "none adequate", reason, notes=notes)
    preferred, best = simplest(eligible, m), min(eligible, key=lambda c: c.bic)
    chosen = tried.profiled(preferred.model, acceptance)
    judged = agreement(chosen, m)
    verdict, reason = _verdict(chosen, judged, m)
    agreeing = frozenset(c.model for c in fitted.results if fitted.agreements[c.model].agrees)
    notes = (
        *check_notes(tried, chosen, judged, acceptance),
        *judged.notes,
        *fit_notes(chosen, best.model, m, tried.left_out),
        *(certificate_note(chosen, m, leads=certificate_leads) if judged.agrees else ()),
    )
    if certificate_leads:
        chosen = led_by_certificate(chosen, m)
    noise = max(chosen.rms_relative, LEAST_NOISE) * float(np.mean(m.brdf))
    return Choice(
        candidates=tuple(_shown(c, chosen, agreeing, m) for c in fitted.results),
        chosen=chosen.model,
        verdict=verdict,
        reason=reason,
        symmetry=symmetry(m, chosen.brdf, noise),
        agreeing=agreeing,
        u_scale=judged.u_scale,
        notes=notes,
    )


def _shown(
    candidate: FitResult, chosen: FitResult, agreeing: frozenset[str], m: Measurements
) -> FitResult:
    """The chosen result whole; others with their best values, and u only where they agree."""
    if candidate.model == chosen.model:
        return chosen
    return with_linear_u(candidate, m) if candidate.model in agreeing else candidate


def _verdict(chosen: FitResult, judged: Agreement, m: Measurements) -> tuple[str, str]:
    if chosen.dof <= 0:
        return "not identifiable", f"{chosen.model}: as many parameters as points, no test possible"
    if not judged.agrees:
        worst = worst_stretches(m, without_outliers(chosen))
        return "none adequate", f"{judged.reason}; worst at {'; '.join(map(str, worst))}"
    if chosen.undetermined:
        names = ", ".join(
            f"{name} (anywhere in {chosen.intervals[name][0]:.4g} to "
            f"{chosen.intervals[name][1]:.4g})"
            for name in chosen.undetermined
        )
        return "not identifiable", f"{judged.reason}; the data do not determine {names}"
    return "adequate", judged.reason
