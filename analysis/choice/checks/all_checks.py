"""Checks of the data, called once for each choice of a model: each finding becomes a note.

A check claims something only with evidence that noise and a missing model do not give. No check
changes data or verdict. Where the chosen model explains the data within the stated u, only the
checks without a fit are made.
"""

from __future__ import annotations

from analysis.choice.adequacy import Agreement
from analysis.choice.candidates import Candidates
from analysis.choice.checks.angle_units import angle_unit_text
from analysis.choice.checks.mistakes import cosines_in_minnaert, suspected_mistake
from analysis.choice.checks.outliers import outliers
from analysis.choice.checks.reciprocity import reciprocity
from analysis.choice.checks.reflectance import reflectance_above_one
from analysis.choice.notes import Note, NoteCode
from analysis.choice.runs_test import runs_probability
from analysis.data.acceptance import Acceptance
from analysis.data.measurements import Measurements
from analysis.fit.criteria import SIGNIFICANCE
from analysis.fit.fit import FitResult


def check_notes(
    tried: Candidates, chosen: FitResult, judged: Agreement, acceptance: Acceptance | None
) -> tuple[Note, ...]:
    """Notes on the measurements behind a chosen fit, judged by its agreement with them."""
    found = free_check_notes(tried.fits.measurements)
    cosines = cosines_in_minnaert(chosen, tried.fits.measurements) if judged.agrees else ""
    if cosines:
        return (*found, Note(NoteCode.COSINE_FACTOR, cosines))
    if judged.within_u or any(note.code is NoteCode.ANGLE_UNIT for note in found):
        return found
    return found + _explanations(tried, chosen, judged, acceptance)


def free_check_notes(m: Measurements) -> tuple[Note, ...]:
    """Notes of the checks that need no fit."""
    above = reflectance_above_one(m)
    texts = {
        NoteCode.ANGLE_UNIT: angle_unit_text(m),
        NoteCode.REFLECTANCE_ABOVE_ONE: "" if above is None else str(above),
    }
    return tuple(Note(code, text) for code, text in texts.items() if text)


def _explanations(
    tried: Candidates, chosen: FitResult, judged: Agreement, acceptance: Acceptance | None
) -> tuple[Note, ...]:
    """Reasons why the chosen model does not explain the data, the cheapest check first.

    One that explains all of the misfit ends the search.
    """
    found: tuple[Note, ...] = ()
    broken = reciprocity(tried.measurements, chosen.brdf)
    if broken is not None:
        if broken.by_cosine:
            return (Note(NoteCode.COSINE_FACTOR, str(broken)),)
        found = (Note(NoteCode.NOT_RECIPROCAL, str(broken)),)
    m = tried.fits.measurements
    if reflectance_above_one(m) is not None:  # told already, and it explains a misfit
        return found
    few = None if tried.robust else outliers(tried.first, m, acceptance, chosen)
    if few is not None:
        return (*found, Note(NoteCode.POSSIBLE_OUTLIERS, few.text(m)))
    if judged.agrees and runs_probability(m, chosen.residuals) > SIGNIFICANCE:
        return found
    suspected = suspected_mistake(tried.first, m)
    return found if suspected is None else (*found, Note(*suspected))
