"""Mistakes in a table: is a model right once the mistake is undone, and none as the data stand?

Each mistake is undone in turn and one model, a rough matt surface with gloss, is fitted. A mistake
is told only where its undoing lowers the misfit to a fraction of that of every model tried on the
data as they stand.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from analysis.choice.notes import NoteCode
from analysis.data.measurements import Measurements
from analysis.fit.first_fit import FirstFit, FirstFits, enough_points
from analysis.fit.fit import FitResult
from analysis.models import MODELS
from instrument.geometry import FloatArray

_MODEL = "oren_nayar+torrance_sparrow_lobe"
# Misfit with a mistake undone: at most this fraction of that of the best model of the data as they
# stand, and of the mean value. In none of the 61 real materials of the CUReT database does any
# undoing lower the misfit, though half of them have no adequate model: the smallest ratio is 1.03.
_CLEARLY_BETTER, _MAX_RMS_RELATIVE = 0.5, 0.05
_AS_GOOD = 1.5  # ratio of misfits up to which another mistake explains the data as well
_MOST_POINTS = 400  # of the fits; more points make them slower, and not clearer
_FEWEST_PER_PARAMETER = 2
# k of Minnaert's law, k = 1 of a matt surface and 2 of one times cosines, from which that is told.
_COSINES_K = 1.9
_DARK = 1e-3  # cosine below which a value cannot be divided by it


class Suspected(NamedTuple):
    """A mistake that explains the data: the code and the text of its note."""

    code: NoteCode
    text: str


class _Mistake(NamedTuple):
    """A mistake: name, effect and remedy in words, and a function that undoes it."""

    name: str
    code: NoteCode
    effect: str
    remedy: str
    undo: Callable[[Measurements], Measurements]


_SWAPPED = _Mistake(
    "lamp side",
    NoteCode.LAMP_SIDE,
    "the lamp stood on the other side (the sign of theta_r, or dphi by 180 degrees, is wrong)",
    "turn the sign of theta_r, unless the sample sends light back to the lamp (retro-reflector)",
    lambda m: replace(m, dphi_deg=m.dphi_deg + 180.0),
)


def _cosine(name: str, cosine: Callable[[Measurements], FloatArray]) -> _Mistake:
    return _Mistake(
        name,
        NoteCode.COSINE_FACTOR,
        f"the values are the BRDF times {name}",
        f"divide them by {name}",
        lambda m: _divided(m, cosine(m)),
    )


_COS_I = _cosine("cos(theta_i)", lambda m: np.cos(m.geometry.theta_i))
_COS_R = _cosine("cos(theta_r)", lambda m: np.cos(m.geometry.theta_r))
_COS_BOTH = _cosine(
    "cos(theta_i) cos(theta_r)",
    lambda m: np.cos(m.geometry.theta_i) * np.cos(m.geometry.theta_r),
)
_RADIANS = _Mistake(
    "radians",
    NoteCode.ANGLE_UNIT,
    "the angles are in radians (none is above 1.58)",
    "convert them: angles are read in degrees",
    lambda m: replace(
        m,
        theta_i_deg=np.minimum(np.degrees(m.theta_i_deg), 90.0),
        theta_r_deg=np.clip(np.degrees(m.theta_r_deg), -90.0, 90.0),
        dphi_deg=np.degrees(m.dphi_deg),
    ),
)


def suspected_mistake(first: Sequence[FirstFit], m: Measurements) -> Suspected | None:
    """The mistake whose undoing explains the data best, None where none is clearly better.

    `first`: the models' first fits to the data as they stand.
    """
    part = _thinned(m)
    needed = _FEWEST_PER_PARAMETER * len(MODELS[_MODEL].parameters)
    own = _fit_of(part) if part.size >= needed else None
    if own is None:
        return None
    fits = [f for f in first if f.solution.converged]
    as_given = min((_misfit(f), _rms(f)) for f in (*fits, own))
    undone = [(_fit_of(mistake.undo(part)), mistake) for mistake in _possible(m)]
    found = [(fit, mistake) for fit, mistake in undone if fit is not None]
    found.sort(key=lambda one: _misfit(one[0]))
    if not found or not _clearly_better(found[0][0], as_given[0]):
        return None
    best = found[0][0]
    also = [b for f, b in found[1:] if _misfit(f) <= _AS_GOOD * _misfit(best)]
    return _told(found[0][1], also, before=as_given[1], after=_rms(best))


def cosines_in_minnaert(chosen: FitResult, m: Measurements) -> str:
    """Return that Minnaert's law with k near 2 is a matt surface times cosines; "" for others."""
    if chosen.model != "minnaert" or chosen.values["k"] < _COSINES_K:
        return ""
    name = _COS_R.name if m.free_levels or np.ptp(m.theta_i_deg) < 1.0 else _COS_BOTH.name
    return (
        f"minnaert with k = {chosen.values['k']:.3g} is Lambert's law times {name}: the values may "
        f"be the BRDF times {name}. If so, divide them by {name}"
    )


def _possible(m: Measurements) -> list[_Mistake]:
    """Mistakes that would change the data: relative levels, or one incidence, hide a cosine."""
    one_incidence = np.ptp(m.theta_i_deg) < 1.0
    found = [_SWAPPED, _COS_R]
    if not (one_incidence or m.free_levels):
        found += [_COS_I, _COS_BOTH]
    if max(np.max(m.theta_i_deg), np.max(np.abs(m.theta_r_deg))) <= math.pi / 2 + 1e-3:
        found.append(_RADIANS)
    return found


def _fit_of(m: Measurements) -> FirstFit | None:
    """First fit of the model; None for too few points, or for a part of them that has no light."""
    model = MODELS[_MODEL]
    if not (enough_points(model, m) and np.mean(m.brdf) > 0):
        return None
    return FirstFits(m).of(model)


def _clearly_better(fit: FirstFit, as_given: float) -> bool:
    return _misfit(fit) <= _CLEARLY_BETTER * as_given and _rms(fit) <= _MAX_RMS_RELATIVE


def _misfit(fit: FirstFit) -> float:
    """Root mean square of the residuals in u; relative to the mean where no u is stated."""
    variance = fit.problem.covariance.variance
    if np.all(variance == 1.0):
        return _rms(fit)
    return math.sqrt(fit.solution.chi2 / fit.problem.brdf.size)


def _rms(fit: FirstFit) -> float:
    """Root mean square of the residuals over the mean value."""
    residual = fit.problem.predict(fit.solution.x) - fit.problem.brdf
    mean = float(np.mean(fit.problem.brdf))
    return float(np.sqrt(np.mean(np.square(residual)))) / mean if mean > 0 else math.inf


def _told(mistake: _Mistake, also: Sequence[_Mistake], *, before: float, after: float) -> Suspected:
    others = "; as likely: " + "; ".join(other.effect for other in also) if also else ""
    return Suspected(
        mistake.code,
        f"it seems that {mistake.effect}: {_MODEL} then fits with an rms residual of "
        f"{100 * after:.2g} % of the mean, and no model tried fits the data as they stand (best "
        f"{100 * before:.2g} %){others}. If so, {mistake.remedy}",
    )


def _divided(m: Measurements, cosine: FloatArray) -> Measurements:
    """Measurements whose values are divided by a cosine (N,), without those where it vanishes."""
    lit = cosine > _DARK
    kept, by = m.subset(lit), cosine[lit]
    u = None if kept.u_random is None else kept.u_random / by
    return replace(kept, brdf=kept.brdf / by, u_random=u)


def _thinned(m: Measurements) -> Measurements:
    """At most `_MOST_POINTS` of the points, evenly chosen in their order."""
    if m.size <= _MOST_POINTS:
        return m
    chosen = np.zeros(m.size, dtype=bool)
    chosen[np.linspace(0, m.size - 1, _MOST_POINTS).astype(np.int64)] = True
    return m.subset(chosen)
