"""Cross-validation of models: prediction of incidences or view angles left out of the fit.

Single points would not do: neighbours nearly determine them, even under a wrong model. Absolute
errors are summed and not their squares, so that a single lobe that no fitted point sampled, and
the few points in it, do not decide alone.
"""

from __future__ import annotations

import numpy as np

from analysis.data.measurements import Measurements
from analysis.data.sweeps import signed_view
from analysis.fit.search.problem import Problem
from instrument.geometry import BoolArray, FloatArray, IntArray

MAX_FOLDS = 5
_MIN_INCIDENCES = 3
_RTOL = 1e-5  # of chi2: the last step of a fit without the points left out
_MAX_LEFT_OUT = 0.5  # of the points: a fit to fewer predicts little, whatever the model
FEW = 4000
"""Points to which a model is fitted quickly: errors of prediction are then known to 1 or 2 %."""


def folds(m: Measurements) -> list[BoolArray]:
    """Masks (N,), True for the points of one fold: neighbouring incidences, or view angles.

    View angles where there are fewer than three incidences, or most points belong to one. An empty
    list where all points would be in one fold.
    """
    incidences = np.round(m.theta_i_deg, 3)
    found = _blocks(incidences) if np.unique(incidences).size >= _MIN_INCIDENCES else []
    if not found or max(map(np.mean, found)) > _MAX_LEFT_OUT:
        found = _blocks(signed_view(m))
    return found if len(found) > 1 else []


def _blocks(values: FloatArray) -> list[BoolArray]:
    """Blocks of neighbouring values with about equally many points; equal values stay together."""
    known, member, count = np.unique(values, return_inverse=True, return_counts=True)
    number = min(MAX_FOLDS, known.size)
    middle = np.cumsum(count) - count / 2
    block: IntArray = np.floor(middle * number / values.size).astype(np.int64)
    found = [block[member.reshape(-1)] == n for n in range(number)]
    return [points for points in found if np.any(points)]


def held_out_error(
    m: Measurements,
    problem: Problem,
    x: FloatArray,
    left_out: list[BoolArray],
    most: int | None = None,
) -> float:
    """Sum of the absolute prediction errors at the points left out, over all folds.

    In units of u, plus a 2 sqrt(2)th of ln det C of the points: together, but for a constant and a
    factor, the log score of predictions with a Laplace distribution of covariance C. As C is
    linearised about the model's own curve, errors in units of u alone would favour the model with
    the larger C. In 1/sr where no u is stated, because the noise estimates of robust fits differ.
    `left_out` are masks (N,), as `folds` returns them; `x` (K,), in the parameters' own
    units, is the fit to all points, from which the fits to fewer start. `most`: points, drawn at
    random (seeded), of each such fit; None: all that are not left out.
    """
    total, atol = 0.0, _RTOL * problem.chi2(x) * min(1.0, (most or m.size) / m.size)
    unit = 1.0 if m.u_random is not None else float(np.sqrt(np.mean(problem.covariance.variance)))
    for points in left_out:
        found = problem.subset(_drawn(~points, most)).solve(x, atol=atol)
        tested = problem.subset(points)
        total += float(np.sum(np.abs(tested.residual(found.x))))
        if m.u_random is not None:
            independent = 2 * float(np.sum(np.log(m.u_random[points])))
            total += (tested.covariance.log_determinant - independent) / (2 * np.sqrt(2))
    return total * unit


def _drawn(points: BoolArray, most: int | None) -> BoolArray:
    """Mask (N,) of at most so many of the points: no step from one to the next, as a grid has."""
    fitted = np.flatnonzero(points)
    if most is None or fitted.size <= most:
        return points
    chosen = np.zeros_like(points)
    chosen[np.random.default_rng(0).choice(fitted, most, replace=False)] = True
    return chosen
