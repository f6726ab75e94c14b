"""Fits to what the rig averages over, without averaging at every step of the search.

The averaged model is written as gain * model + offset, both found at the parameters of the last
round; the search runs with them fixed; then they are found anew, until that changes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from analysis.data.acceptance import Acceptance, averaged_brdf, rings_each
from analysis.data.measurements import Measurements
from analysis.fit.levenberg_marquardt import Minimum
from analysis.fit.problem import Problem
from instrument.geometry import FloatArray, Geometry, IntArray

MOST_ROUNDS = 12

# All in units of the points' independent uncertainty: what averaging must change to be worth it,
# what a round may still change, and what one more ring of the quadrature may change.
WORTH, SETTLED, _RING = 1 / 3, 0.05, 0.2

# Beyond these ratios a gain would magnify errors of a nearly vanishing model: then an offset.
_LEAST_GAIN, _MOST_GAIN = 0.1, 5.0


@dataclass(frozen=True, slots=True)
class Averaged:
    """A solution, its problem, whether averaging was worth it, and whether its rounds settled."""

    problem: Problem
    solution: Minimum
    used: bool
    settled: bool


def average(
    problem: Problem,
    solution: Minimum,
    measurements: Measurements,
    acceptance: Acceptance,
    u: FloatArray,
) -> Averaged:
    """Fit again with the model averaged over the rig's acceptance, where that is worth it.

    `solution` is the fit without averaging, `u` (N,) in 1/sr what counts as a change.
    """
    rings = _rings(problem, solution.x, measurements, acceptance, u)
    mean = _mean(problem, solution.x, measurements, acceptance, rings)
    if np.all(np.abs(mean - problem.plain(solution.x)) <= WORTH * u):
        return Averaged(problem, solution, False, True)
    settled = False
    for _ in range(MOST_ROUNDS):
        problem = _corrected(problem, solution.x, mean)
        solution = problem.solve(solution.x)
        rings = np.maximum(rings, _rings(problem, solution.x, measurements, acceptance, u))
        mean = _mean(problem, solution.x, measurements, acceptance, rings)
        settled = bool(np.all(np.abs(mean - problem.predict(solution.x)) < SETTLED * u))
        if settled:
            break
    return Averaged(problem, solution, True, settled)


def _corrected(problem: Problem, x: FloatArray, mean: FloatArray) -> Problem:
    plain = problem.plain(x)
    gentle = (mean * plain > 0) & (np.abs(mean) < _MOST_GAIN * np.abs(plain))
    gentle &= np.abs(mean) > _LEAST_GAIN * np.abs(plain)
    gain = np.divide(mean, plain, out=np.ones_like(mean), where=gentle)
    return replace(problem, gain=gain, offset=np.where(gentle, 0.0, mean - plain))


def _rings(
    problem: Problem, x: FloatArray, m: Measurements, acceptance: Acceptance, u: FloatArray
) -> IntArray:
    size = np.maximum(np.abs(problem.plain(x)), u)
    return rings_each(
        lambda geometry: problem.plain(x, geometry),
        m.theta_i_deg,
        m.theta_r_deg,
        m.dphi_deg,
        acceptance,
        tolerance=_RING * u / size,
    )


def _mean(
    problem: Problem, x: FloatArray, m: Measurements, acceptance: Acceptance, rings: IntArray
) -> FloatArray:
    """The averaged model, (N,), each point with its own number of rings."""

    def brdf(geometry: Geometry) -> FloatArray:
        return problem.plain(x, geometry)

    mean = np.empty(m.size)
    for n in np.unique(rings):
        k = rings == n
        mean[k] = averaged_brdf(
            brdf, m.theta_i_deg[k], m.theta_r_deg[k], m.dphi_deg[k], acceptance, int(n)
        )
    return mean
