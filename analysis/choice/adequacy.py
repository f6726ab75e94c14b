"""Agreement of a fitted candidate with the data: within the stated u, with a larger u, or not.

Where u is stated, chi2 and the runs test of the residuals judge. Where it is not, or where chi2
fails although the residuals are random, the rms residual must not exceed 5 %: of the mean, or, for
values that span more than two decades, of each point's own value; nor 30 times the stated u.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from analysis.choice.notes import Note, NoteCode
from analysis.choice.runs_test import least_runs_probability, runs_probability
from analysis.choice.symmetry_test import p_text
from analysis.data.measurements import Measurements
from analysis.fit.criteria import LEAST_NOISE, SIGNIFICANCE, probability
from analysis.fit.fit import FitResult
from instrument.geometry import FloatArray

MAX_RMS_RELATIVE = 0.05
MOST_U_SCALE = 30.0
"""Factor by which a stated u may be too small; beyond it the misfit is the model's.

As of a u of the noise alone, 0.1 %, where placement and texture change the values by 3 %.
"""
# Ratio of the largest to the smallest value beyond which the rms over the mean says nothing about
# most points.
_WIDE_RANGE = 100.0
# Residuals are called random only where the runs test does not reject that even at this level.
_RANDOM = 0.05
# A smaller reduced chi2 shows that the stated u includes errors that points share. Residuals of one
# sign in a row are then expected.
_SHARED_U_CHI2 = 0.5


@dataclass(frozen=True, slots=True)
class Agreement:
    """Agreement of one candidate with the data.

    within_u: it agrees within the stated u; where none is stated, to rounding. u_scale: factor on
    the stated u with which it agrees; None where it agrees without one or not at all. agrees: in
    one of these ways, or, where no u is stated, with an rms residual of at most 5 %. reason: the
    tests and their results.
    """

    agrees: bool
    within_u: bool
    u_scale: float | None
    reason: str
    notes: tuple[Note, ...]


def agreement(result: FitResult, m: Measurements) -> Agreement:
    """Judge a fitted candidate."""
    if not result.converged:
        return Agreement(False, False, None, f"{result.model}: {result.message}", ())
    if result.chi2 is None:
        return _without_u(result, m)
    by_chi2 = probability(result.chi2, result.dof)
    residuals = without_outliers(result)
    by_runs = runs_probability(m, residuals)
    reason = (
        f"{result.model}: chi2 {result.chi2:.4g} for {result.dof} degrees of freedom, "
        f"{p_text(by_chi2)}; runs test of the residuals' signs, {p_text(by_runs)} "
        f"(rejected below {SIGNIFICANCE:g})"
    )
    if result.chi2 < _SHARED_U_CHI2 * result.dof:
        text = "the stated u exceeds the scatter of the points, so the runs test is ignored"
        return Agreement(True, True, None, reason, (Note(NoteCode.U_TOO_LARGE, text),))
    if min(by_runs, by_chi2) > SIGNIFICANCE:
        return Agreement(True, True, None, reason, ())
    rms, _ = rms_judged(result, m)
    scale = math.sqrt(result.chi2 / max(result.dof, 1))
    off = by_runs < _RANDOM or rms > MAX_RMS_RELATIVE or result.dof <= 0 or scale > MOST_U_SCALE
    if off or least_runs_probability(m, residuals) >= SIGNIFICANCE:  # they cannot but pass
        return Agreement(False, False, None, reason, ())
    return Agreement(True, False, scale, reason, (_u_too_small(scale, rms),))


def rms_judged(result: FitResult, m: Measurements) -> tuple[float, str]:
    """The rms residual that is judged, as a fraction, and "the mean" or "each value".

    A residual relative to each value is divided by the larger of measured and fitted value.
    """
    if not wide_range(m):
        return result.rms_relative, "the mean"
    larger = np.maximum(np.abs(m.brdf), np.abs(result.predicted))
    size = np.abs(m.brdf - result.predicted)
    relative = np.divide(size, larger, out=np.zeros(m.size), where=larger > 0)[~result.outliers]
    return float(np.sqrt(np.mean(np.square(relative)))), "each value"


def wide_range(m: Measurements) -> bool:
    """True if the positive values span more than two decades."""
    positive = m.brdf[m.brdf > 0]
    return bool(positive.size) and float(positive.max()) / _WIDE_RANGE > float(positive.min())


def without_outliers(result: FitResult) -> FloatArray:
    """Residuals (N,) in units of u, 0 at outliers, which thereby belong to no run of one sign."""
    return np.where(result.outliers, 0.0, result.residuals)


def _without_u(result: FitResult, m: Measurements) -> Agreement:
    rms, of = rms_judged(result, m)
    reason = (
        f"{result.model}: rms residual {100 * rms:.3g} % of {of}, allowed "
        f"{100 * MAX_RMS_RELATIVE:g} % (no u stated)"
    )
    notes = (_wide_range_note(result, m),) if wide_range(m) else ()
    exact = result.rms_relative <= LEAST_NOISE
    return Agreement(rms <= MAX_RMS_RELATIVE, exact, None, reason, notes)


def _wide_range_note(result: FitResult, m: Measurements) -> Note:
    larger = np.maximum(np.abs(m.brdf), np.abs(result.predicted))
    far = int(np.sum(np.abs(m.brdf - result.predicted) > larger / 2))
    text = (
        "the values span more than two decades and no u is stated: residuals are judged relative "
        f"to each value; {far} of {m.size} points are off by more than a factor of 2; state u_brdf "
        "for a fit that weighs them"
    )
    return Note(NoteCode.WIDE_RANGE, text)


def _u_too_small(scale: float, rms: float) -> Note:
    text = (
        f"chi2 is {scale:.3g} squared per degree of freedom, but the residuals are random and "
        f"their rms is {100 * rms:.2g} %: the stated u is too small by that factor, {scale:.3g}"
    )
    return Note(NoteCode.U_TOO_SMALL, text)
