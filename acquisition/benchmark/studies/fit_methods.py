"""Fit methods: time per fit against the distance from the optimum, and the starts that miss it.

Every method gets the same noisy scans and the same random starts over the whole domain.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import numpy as np

from acquisition.benchmark.effort import Effort
from acquisition.benchmark.number_text import percent, rounded
from acquisition.benchmark.peers import is_usable, lmfit_minimum
from acquisition.benchmark.studies.fit_truth import (
    SCENES,
    Optimum,
    noisy_scan,
    optimum,
    random_starts,
    with_scales,
)
from acquisition.benchmark.studies.method import Method
from acquisition.benchmark.study import Study
from acquisition.benchmark.trial import Trial, select
from analysis.data.measurements import Measurements
from analysis.fit.first_fit import first_fit
from analysis.fit.search.problem import Problem
from instrument.geometry import FloatArray

MISSED_U = 0.1
"""A result further from the optimum than this, in standard uncertainties, has missed it."""

Solve = Callable[[Problem, FloatArray], FloatArray]
"""Parameters, (parameters,) in their units, from a problem and a start of the same form."""


def program_fit(problem: Problem, start: FloatArray) -> FloatArray:
    """Fit as the program does; a `Solve` that ignores its start (shape and units as there).

    Starts come from a coarse grid, with the linear parameters solved for.
    """
    del start
    g, u = problem.geometry, np.sqrt(problem.covariance.variance)
    points = Measurements.bare(g.theta_i_deg, g.theta_r_deg, g.dphi_deg, problem.brdf, u)
    return first_fit(problem.model, points).solution.x


def lmfit_fit(problem: Problem, start: FloatArray) -> FloatArray:
    """Fit with lmfit's default method on the same residuals; shape and units as in `Solve`."""
    return lmfit_minimum(problem.residual, start, problem.low, problem.high)


def _descent(problem: Problem, start: FloatArray) -> FloatArray:
    return problem.solve(start).x


def _scales_solved(problem: Problem, start: FloatArray) -> FloatArray:
    return problem.solve(with_scales(problem, start)).x


def _by_differences(problem: Problem, start: FloatArray) -> FloatArray:
    """Descend with derivatives by central differences."""
    return replace(problem, model=replace(problem.model, gradient_kernel=None)).solve(start).x


def _scipy(
    problem: Problem, start: FloatArray, *, method: Literal["trf", "dogbox"], analytic: bool = True
) -> FloatArray:
    from scipy.optimize import least_squares

    found = least_squares(
        problem.residual,
        start,
        jac=problem.jacobian if analytic else "2-point",
        bounds=(problem.low, problem.high),
        method=method,
        x_scale=problem.high - problem.low,
    )
    return np.asarray(found.x)


def _simplex(problem: Problem, start: FloatArray) -> FloatArray:
    """Nelder and Mead's simplex on chi2, without derivatives."""
    from scipy.optimize import Bounds, minimize

    span = problem.high - problem.low

    def chi2(y: FloatArray) -> float:
        return problem.chi2(problem.low + y * span)

    options: Any = {"xatol": 1e-7, "fatol": 1e-9, "maxfev": 1000}  # the stubs know no xatol
    found = minimize(
        chi2,
        (start - problem.low) / span,
        method="Nelder-Mead",
        bounds=Bounds(np.zeros(span.size), np.ones(span.size)),
        options=options,
    )
    return np.asarray(problem.low + found.x * span)


_ANALYTIC = "analytic derivatives"
_TRF, _DOGBOX = partial(_scipy, method="trf"), partial(_scipy, method="dogbox")

METHODS: tuple[Method[Solve], ...] = (
    Method(
        "program", "grid, scales solved", program_fit, default=True, own_starts=True,
        note=f"{_ANALYTIC}; starts are found, not given",
    ),
    Method("program", "start, scales solved", _scales_solved, note=_ANALYTIC),
    Method("program", "descent", _descent, note=f"{_ANALYTIC}, all parameters searched"),
    Method("program", "descent, differences", _by_differences, note="central differences"),
    Method("SciPy", "trf", _TRF, note=_ANALYTIC),
    Method("SciPy", "trf, differences", partial(_TRF, analytic=False), note="forward differences"),
    Method("SciPy", "dogbox", _DOGBOX, note=_ANALYTIC),
    Method("SciPy", "simplex", _simplex, note="no derivatives"),
)  # fmt: skip


def methods() -> tuple[Method[Solve], ...]:
    """Return all methods that can be measured here."""
    lmfit = Method("another program", "lmfit", lmfit_fit, peer=True, note="leastsq")
    return (*METHODS, lmfit) if is_usable("lmfit") else METHODS


def fit_studies(effort: Effort) -> tuple[Study, Study]:
    """Compare all methods in all scenes: distance from the optimum, and starts that miss it."""
    near = _near(effort)
    return near, _misses(near)


def _near(effort: Effort) -> Study:
    name, trials = "fit", list[Trial]()
    for scene in SCENES:
        problems = [noisy_scan(scene, seed) for seed in range(effort.data_sets)]
        best = [optimum(problem) for problem in problems]
        trials += [_trial(name, scene.name, m, problems, best, effort.starts) for m in methods()]
    return Study(
        name=name,
        title="Fit: solver, derivatives, and linear parameters solved for or searched",
        cost_axis="time per fit (ms)",
        error_axis="distance from the optimum (u), worst",
        caption=_near_caption(trials),
        truth=f"deepest minimum of many descents; {effort.starts} random starts over the whole "
        f"domain, {effort.data_sets} noisy scans; results further off than {MISSED_U:g} u are "
        "misses and do not count for the worst",
        trials=tuple(trials),
    )


def _near_caption(trials: Sequence[Trial]) -> str:
    own, others = select(trials, default=True), [t for t in trials if t.peer]
    times = ", ".join(rounded(t.cost) for t in own)
    peers = f"; lmfit takes {', '.join(rounded(t.cost) for t in others)} ms" if others else ""
    return (
        f"The program takes {times} ms with 2, 3 and 5 parameters, including its search for a start"
        f"{peers}.\nEvery solver that converges ends far closer than one standard uncertainty: "
        "solvers differ in their time and in the misses of the next chart, not in the last digits."
    )


def _misses(near: Study) -> Study:
    """Return the same fits with the fraction of starts that miss the optimum as the error."""
    name = "fit_misses"
    parts = [t.failures / t.attempts for t in near.trials]
    trials = tuple(
        replace(t, study=name, error=part, error_median=part)
        for t, part in zip(near.trials, parts, strict=True)
    )
    return replace(
        near,
        name=name,
        title="Fit: which solver misses the optimum",
        error_axis="part of the starts that miss it",
        caption=_misses_caption(trials),
        trials=trials,
        error_is="part missed",
    )


def _misses_caption(trials: Sequence[Trial]) -> str:
    own = select(trials, default=True)
    hardest = select(trials, scene=SCENES[-1].name, default=False)
    words = [f"{t.label} {percent(t.error)}" for t in hardest]
    return (
        f"With its own starts the program misses {sum(t.failures for t in own)} of "
        f"{sum(t.attempts for t in own)} scans.\nFrom random starts over the whole domain, with 5 "
        f"parameters, these parts miss it: {', '.join(words)}."
    )


def _trial(
    study: str,
    scene: str,
    method: Method[Solve],
    problems: list[Problem],
    best: list[Optimum],
    count: int,
) -> Trial:
    begin = random_starts(problems[0], len(problems) if method.own_starts else count)
    method.call(problems[0], begin[0])  # first imports are not part of the cost
    seconds, distances = [], []
    for n, start in enumerate(begin):
        at = n % len(problems)
        begun = time.process_time()
        x = _solved(method.call, problems[at], start)
        seconds.append(time.process_time() - begun)
        distances.append(best[at].distance_u(x))
    off = np.array(distances)
    arrived = off[off <= MISSED_U]
    return method.trial(
        study,
        scene,
        cost=1e3 * float(np.median(seconds)),
        error=float(np.max(arrived)) if arrived.size else math.inf,
        error_median=float(np.median(off)),
        failures=int(np.sum(off > MISSED_U)),
        attempts=off.size,
    )


def _solved(solve: Solve, problem: Problem, start: FloatArray) -> FloatArray:
    """Return the solver's result; NaN if it gave up, which counts as a miss."""
    try:
        return solve(problem, start)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError):
        return np.full_like(start, np.nan)
