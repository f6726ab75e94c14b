"""Runs test of residuals: too few changes of sign along a sweep show a systematic misfit.

Source: A. Wald, J. Wolfowitz, "On a Test Whether Two Samples Are from the Same Population", Annals
of Mathematical Statistics 11 (1940).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from analysis.data.measurements import Measurements
from analysis.data.sweeps import Sweep, plane_and_view, sweeps
from instrument.geometry import FloatArray, IntArray

# A further stretch is reported from this many standard deviations of its mean.
_NOTABLE = 3.0


def runs_probability(m: Measurements, residuals: FloatArray) -> float:
    """Probability of at most this many runs of equal signs, in all sweeps, if all is noise.

    `residuals` (N,) in units of u, in the order of the points. 1 where no sweep has residuals of
    both signs, for few points and for alternating residuals: only runs that are too long are
    evidence against a model.
    """
    counted = _counted(m, residuals)
    return _probability(*np.sum(counted, axis=0))


def least_runs_probability(m: Measurements, residuals: FloatArray) -> float:
    """Probability of the fewest runs possible with these signs: one for each sign in a sweep.

    `residuals` (N,) in units of u. The test can reject only below this: where it is not small,
    passing the test is no evidence of noise.
    """
    counted = _counted(m, residuals)
    counted[:, 0] = np.where(counted[:, 2] > 0, 2, counted[:, 0])
    return _probability(*np.sum(counted, axis=0))


def _counted(m: Measurements, residuals: FloatArray) -> FloatArray:
    """Runs, their expectation and variance for each of S sweeps, (S, 3)."""
    counted = [_runs(residuals[sweep.points]) for sweep in sweeps(m)]
    return np.reshape(np.array(counted, dtype=np.float64), (-1, 3))


def _probability(runs: float, expected: float, variance: float) -> float:
    """Probability of at most this many runs, by the normal law with a correction for continuity."""
    if variance <= 0:
        return 1.0
    return 0.5 * math.erfc((expected - runs - 0.5) / math.sqrt(2 * variance))


def _runs(residuals: FloatArray) -> tuple[float, float, float]:
    """Number of runs of equal signs in a row of residuals, its expectation and its variance."""
    sign = np.sign(residuals[residuals != 0])
    n, plus = sign.size, int(np.sum(sign > 0))
    if n < 2:
        return 0.0, 0.0, 0.0
    runs = 1 + int(np.sum(sign[1:] != sign[:-1]))
    pairs = 2 * plus * (n - plus)
    return runs, pairs / n + 1, pairs * (pairs - n) / (n * n * (n - 1))


class Stretch(NamedTuple):
    """Neighbouring points of a sweep with residuals of one sign, of `mean` in units of u.

    Angles in degrees. weight: mean residual over its standard deviation if all were noise.
    """

    theta_i_deg: float
    dphi_deg: float
    from_deg: float
    to_deg: float
    mean: float
    weight: float

    def __str__(self) -> str:
        where = f"theta_r {self.from_deg:g}"
        if self.to_deg != self.from_deg:
            where += f" to {self.to_deg:g}"
        return (
            f"theta_i {self.theta_i_deg:g}, dphi {self.dphi_deg:g} degrees: {where} degrees "
            f"({self.mean:+.2g} u)"
        )


def worst_stretches(m: Measurements, residuals: FloatArray, most: int = 3) -> list[Stretch]:
    """At most `most` stretches where a model fits worst, the worst first.

    `residuals` (N,) are in units of u, 0 for points set aside. All but the first of the stretches
    are significant.
    """
    plane, views = plane_and_view(m)
    swept = sweeps(m)
    inside = np.concatenate([s.points for s in swept]) if swept else np.zeros(0, dtype=np.int64)
    outside = np.setdiff1d(np.arange(m.size), inside)
    single = [
        Sweep(float(m.theta_i_deg[k]), float(plane[k]), np.array([k]))
        for k in outside[residuals[outside] != 0]
    ]
    parts = [(s, part) for s in swept for part in _one_sided(s.points, residuals)]
    parts += [(s, s.points) for s in single]
    weights = _weights(residuals, [part for _, part in parts])
    worst = [parts[n] for n in np.argsort(-weights, kind="stable")[:most]]
    found = [_stretch(sweep, points, m, views, residuals) for sweep, points in worst]
    return [s for n, s in enumerate(found) if n == 0 or s.weight > _NOTABLE]


def _weights(residuals: FloatArray, parts: list[IntArray]) -> FloatArray:
    """Weight of each of P stretches (P,): its mean residual over that one's u."""
    if not parts:
        return np.zeros(0)
    sizes = np.array([part.size for part in parts])
    sums = np.add.reduceat(residuals[np.concatenate(parts)], np.cumsum(sizes) - sizes)
    return np.asarray(np.abs(sums) / np.sqrt(sizes))


def _one_sided(points: IntArray, residuals: FloatArray) -> list[IntArray]:
    """The points split where the sign of the residuals changes, without residuals of 0."""
    points = points[residuals[points] != 0]
    if points.size == 0:
        return []
    sign = residuals[points] > 0
    return np.split(points, np.flatnonzero(sign[1:] != sign[:-1]) + 1)


def _stretch(
    sweep: Sweep, points: IntArray, m: Measurements, views: FloatArray, residuals: FloatArray
) -> Stretch:
    """Stretch named by the points' own dphi where they have one, else by the sweep's.

    views: theta_r (N,) signed in the plane, in degrees.
    """
    mean = float(np.mean(residuals[points]))
    weight = abs(mean) * math.sqrt(points.size)
    own = np.unique(m.dphi_deg[points])
    dphi, views = (float(own[0]), m.theta_r_deg) if own.size == 1 else (sweep.dphi_deg, views)
    ends = float(views[points[0]]), float(views[points[-1]])
    return Stretch(sweep.theta_i_deg, dphi, min(ends), max(ends), mean, weight)
