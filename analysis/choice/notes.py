"""Notes on a result: a code that scripts can rely on, and a sentence to read.

`NoteCode` lists every code that can stand in `fit.json`.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from analysis.data.measurements import Measurements
from analysis.fit.certificate import certificate_u, told_by
from analysis.fit.fit import FitResult

_MOST_OUTLIERS = 10  # that are listed
_OVERRULED = 0.8  # u of the certificate after the fit, in its own u, at which this deserves a note


class NoteCode(StrEnum):
    """Kind of a note; the words are stable."""

    # Choice of a model.
    U_NOT_STATED = "u_not_stated"
    U_TOO_SMALL = "u_too_small"
    U_TOO_LARGE = "u_too_large"
    WIDE_RANGE = "wide_range"
    OUTLIERS = "outliers"
    SIMPLER_PREFERRED = "simpler_preferred"
    FEW_POINTS = "few_points"
    OUTSIDE_VALIDITY = "outside_validity"
    RELATIVE_VALUES = "relative_values"
    SEARCH_END = "search_end"
    SCALE_BY_FORM = "scale_by_form"
    # Checks of the data: `analysis/choice/checks`.
    NOT_RECIPROCAL = "not_reciprocal"
    REFLECTANCE_ABOVE_ONE = "reflectance_above_one"
    POSSIBLE_OUTLIERS = "possible_outliers"
    COSINE_FACTOR = "cosine_factor"
    ANGLE_UNIT = "angle_unit"
    LAMP_SIDE = "lamp_side"
    # Source of the measurements.
    FLAGGED = "flagged"
    DAMAGED = "damaged"
    REPEATS = "repeats"
    RESTATED = "restated"
    IGNORED_U = "ignored_u"
    U_SHARED = "u_shared"
    ASSUMED_NO_SHARED_ERROR = "assumed_no_shared_error"
    ASSUMED_EXACT_ANGLES = "assumed_exact_angles"
    ASSUMED_SMALL_ACCEPTANCE = "assumed_small_acceptance"
    DIRECTIONS = "directions"
    CUT = "cut"


class Note(NamedTuple):
    """One finding beside the verdict."""

    code: NoteCode
    text: str

    @property
    def json(self) -> dict[str, str]:
        """The note as plain values for JSON."""
        return {"code": str(self.code), "text": self.text}


def fit_notes(
    chosen: FitResult, lowest_bic: str, m: Measurements, left_out: Sequence[str]
) -> tuple[Note, ...]:
    """Notes on the chosen candidate.

    `lowest_bic`: name of the candidate of lowest BIC among those that could be chosen. `left_out`:
    names of models with too many parameters for the points.
    """
    texts = {
        NoteCode.U_NOT_STATED: _noise_text(chosen, m),
        NoteCode.OUTLIERS: _outliers_text(chosen, m),
        NoteCode.SIMPLER_PREFERRED: ""
        if lowest_bic == chosen.model
        else f"{lowest_bic} has the lowest BIC, but improves too little to be preferred",
        NoteCode.FEW_POINTS: f"left out for lack of points: {', '.join(left_out)}"
        if left_out
        else "",
        NoteCode.OUTSIDE_VALIDITY: _validity_text(chosen),
        NoteCode.RELATIVE_VALUES: "the values are relative: parameters that only scale them are "
        "undetermined"
        if m.relative
        else "",
        NoteCode.SEARCH_END: f"the search ended: {chosen.message}",
    }
    return tuple(Note(code, text) for code, text in texts.items() if text)


def certificate_note(chosen: FitResult, m: Measurements, *, leads: bool) -> tuple[Note, ...]:
    """State that the form of a model fixes the scale more closely than the certificate.

    `leads`: the certificate leads all the same.
    """
    told, percent = told_by(chosen, m), 100 * certificate_u(m)
    if told.u > _OVERRULED:
        return ()
    text = (
        f"the form of {chosen.model} tells the error that all values have from the white tile's "
        f"certificate: {told.pull * percent:+.2g} % with a u of {told.u * percent:.2g} %, where "
        f"the certificate has {percent:.2g} %; "
    )
    text += (
        "the certificate leads all the same, by fit: scale in the protocol"
        if leads
        else "the form leads, as far as the model holds; fit: scale: certificate in the protocol "
        "lets the certificate lead"
    )
    return (Note(NoteCode.SCALE_BY_FORM, text),)


def _noise_text(chosen: FitResult, m: Measurements) -> str:
    if m.u_random is not None:
        return ""
    covariance, mean = chosen.problem.covariance, float(np.mean(chosen.problem.brdf))
    noise = covariance.u_independent if covariance.common.shape[1] else chosen.u_total
    percent = 100 * float(np.mean(noise)) / mean if mean else np.nan
    return (
        f"no u is stated: the noise is estimated from the residuals, {percent:.2g} % of the mean; "
        "every u is based on it"
    )


def _outliers_text(chosen: FitResult, m: Measurements) -> str:
    points = np.flatnonzero(chosen.outliers)
    listed = (
        f"theta_i {m.theta_i_deg[k]:g}, theta_r {m.theta_r_deg[k]:g}, dphi {m.dphi_deg[k]:g} "
        f"degrees ({chosen.residuals[k]:+.1f} u)"
        for k in points[:_MOST_OUTLIERS]
    )
    return f"{points.size} outliers set aside: {'; '.join(listed)}" if points.size else ""


def _validity_text(chosen: FitResult) -> str:
    """Number of points outside the fitted model's range of validity, and the reason."""
    valid = chosen.validity
    outside = int(np.sum(~valid.mask))
    if not outside:
        return ""
    return (
        f"{outside} of {valid.mask.size} points are outside the model's range of validity: "
        f"{valid.reason}"
    )
