"""How well a model foretells what it was not fitted to: whole incidences, or blocks of view angle.

Single points would not do: their neighbours nearly tell them, also to a model that is wrong. The
misses are summed and not their squares, so that one lobe that nobody sampled in the fit, and the
few points in it, do not decide alone.
"""

from __future__ import annotations

import numpy as np

from analysis.data.measurements import Measurements
from analysis.data.sweeps import signed_view
from analysis.fit.problem import Problem
from instrument.geometry import BoolArray, FloatArray, IntArray

MOST_FOLDS = 5
_LEAST_INCIDENCES = 3
# A fit to fewer points is near enough to its minimum when a step lowers chi2 by this part of it.
_SETTLED = 1e-5
_MOST_LEFT_OUT = 0.5  # of the points: a fit to fewer foretells little, whatever the model


def folds(m: Measurements) -> list[BoolArray]:
    """Points to leave out, (N,) each: incidences together, or view angles.

    View angles where there are fewer than three incidences, or most points are of one. None where
    all points would be left out at once.
    """
    incidences = np.round(m.theta_i_deg, 3)
    found = _blocks(incidences) if np.unique(incidences).size >= _LEAST_INCIDENCES else []
    if not found or max(map(np.mean, found)) > _MOST_LEFT_OUT:
        found = _blocks(signed_view(m))
    return found if len(found) > 1 else []


def _blocks(values: FloatArray) -> list[BoolArray]:
    """Blocks of neighbouring values, about as many points in each; equal values stay together."""
    known, member, count = np.unique(values, return_inverse=True, return_counts=True)
    number = min(MOST_FOLDS, known.size)
    middle = np.cumsum(count) - count / 2
    block: IntArray = np.floor(middle * number / values.size).astype(np.int64)
    found = [block[member.reshape(-1)] == n for n in range(number)]
    return [points for points in found if np.any(points)]


def held_out(m: Measurements, problem: Problem, x: FloatArray, left_out: list[BoolArray]) -> float:
    """Sum over the folds of the misses' sizes at the points left out of the fit.

    In units of u, or in 1/sr where no u is stated: a robust fit's own estimate would not compare.
    `x` is the fit to all points, from which those to fewer start.
    """
    total, enough = 0.0, _SETTLED * problem.chi2(x)
    unit = 1.0 if m.u_random is not None else float(np.sqrt(np.mean(problem.covariance.variance)))
    for points in left_out:
        found = problem.of(~points).solve(x, enough=enough)
        total += float(np.sum(np.abs(problem.of(points).residual(found.x))))
    return total * unit
