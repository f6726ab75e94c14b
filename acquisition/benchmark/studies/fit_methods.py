"""Ways to fit: milliseconds against the distance from the optimum, and how often it is missed.

Every method gets the same noisy scans and the same random starts over the whole domain. The optimum
of each scan is the deepest minimum of many descents with the tightest tolerance.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from acquisition.benchmark.effort import Effort
from acquisition.benchmark.number_text import percent, rounded
from acquisition.benchmark.peers import installed, lmfit_minimum
from acquisition.benchmark.study import Study
from acquisition.benchmark.trial import Trial
from analysis.data.covariance import Covariance
from analysis.data.measurements import Measurements
from analysis.fit.first_fit import first_fit
from analysis.fit.problem import Problem
from analysis.fit.starting_values import bounded_least_squares, starting_values
from analysis.models import MODELS, Model
from instrument.geometry import FloatArray, Geometry

MISSED_U = 0.1
"""A result further from the optimum than this many standard uncertainties has missed it."""
NOISE = 0.005  # relative, of a point
_GRID_STARTS = 3  # of the program's own, for the optimum
_TIGHT = 1e-15

Scene = tuple[str, str, dict[str, float]]
SCENES: tuple[Scene, ...] = (
    ("matte: 2 parameters", "oren_nayar", {"albedo": 0.8, "sigma_deg": 25.0}),
    (
        "matte and glossy: 3 parameters",
        "oren_nayar+torrance_sparrow",
        {"albedo": 0.8, "sigma_deg": 20.0, "ks": 0.076},
    ),
    (
        "layered and glossy: 5 parameters",
        "lambert+ggx+single_scattering",
        {"albedo": 0.5, "f0": 0.05, "alpha": 0.25, "scattering": 0.4, "asymmetry": -0.4},
    ),
)

Solve = Callable[[Problem, FloatArray], FloatArray]


@dataclass(frozen=True, slots=True)
class Method:
    """`solve(problem, start)` gives the parameters; with `own_starts` it needs no start."""

    series: str
    label: str
    solve: Solve
    default: bool = False
    peer: bool = False
    own_starts: bool = False
    note: str = ""


def as_the_program(problem: Problem, start: FloatArray) -> FloatArray:
    """The program's own: starts from a coarse grid, the linear parameters solved for there."""
    del start
    g, u = problem.geometry, np.sqrt(problem.covariance.variance)
    points = Measurements.bare(g.theta_i_deg, g.theta_r_deg, g.dphi_deg, problem.brdf, u)
    return first_fit(problem.model, points).solution.x


def descent(problem: Problem, start: FloatArray) -> FloatArray:
    """The program's descent from a given start."""
    return problem.solve(start).x


def scales_solved(problem: Problem, start: FloatArray) -> FloatArray:
    """The descent, once the linear parameters have been solved for at the start."""
    return problem.solve(with_scales(problem, start)).x


def by_differences(problem: Problem, start: FloatArray) -> FloatArray:
    """The descent with derivatives by central differences."""
    return replace(problem, model=without_gradient(problem.model)).solve(start).x


def trust_region(problem: Problem, start: FloatArray) -> FloatArray:
    """SciPy's trust-region reflective method with analytic derivatives."""
    return _least_squares(problem, start, "trf", True)


def trust_region_differences(problem: Problem, start: FloatArray) -> FloatArray:
    """SciPy's trust-region reflective method, derivatives by its own differences."""
    return _least_squares(problem, start, "trf", False)


def dogbox(problem: Problem, start: FloatArray) -> FloatArray:
    """SciPy's dogleg in boxes with analytic derivatives."""
    return _least_squares(problem, start, "dogbox", True)


def simplex(problem: Problem, start: FloatArray) -> FloatArray:
    """Nelder and Mead's simplex on chi2: no derivatives at all."""
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


def by_lmfit(problem: Problem, start: FloatArray) -> FloatArray:
    """lmfit's default, on the same residuals."""
    return lmfit_minimum(problem.residual, start, problem.low, problem.high)


METHODS: tuple[Method, ...] = (
    Method(
        "program", "grid, scales solved", as_the_program, True, own_starts=True,
        note="analytic derivatives; starts are found, not asked for",
    ),
    Method("program", "start, scales solved", scales_solved, note="analytic derivatives"),
    Method("program", "descent", descent, note="analytic derivatives, all parameters searched"),
    Method("program", "descent, differences", by_differences, note="central differences"),
    Method("SciPy", "trf", trust_region, note="analytic derivatives"),
    Method("SciPy", "trf, differences", trust_region_differences, note="forward differences"),
    Method("SciPy", "dogbox", dogbox, note="analytic derivatives"),
    Method("SciPy", "simplex", simplex, note="no derivatives"),
)  # fmt: skip


def methods() -> tuple[Method, ...]:
    """All methods that can be measured here."""
    if installed("lmfit") is None:
        return METHODS
    return (*METHODS, Method("another program", "lmfit", by_lmfit, peer=True, note="leastsq"))


def with_scales(problem: Problem, start: FloatArray) -> FloatArray:
    """The start with its scales from bounded linear least squares, the others as they are."""
    scales = [i for i, p in enumerate(problem.model.parameters) if p.scale]
    none = start.copy()
    none[scales] = 0.0
    constant = problem.predict(none)
    columns = []
    for i in scales:
        one = none.copy()
        one[i] = start[i] or problem.high[i] / 2
        columns.append((problem.predict(one) - constant) / one[i])
    whiten = problem.covariance.whiten
    A, b = whiten(np.stack(columns, axis=1)), whiten(problem.brdf - constant)
    found, _ = bounded_least_squares(A[None], b[None], problem.high[scales])
    solved = start.copy()
    solved[scales] = np.maximum(found[0], 1e-3 * problem.high[scales])
    return solved


def without_gradient(model: Model) -> Model:
    """The model without derivatives of its own: central differences in their place."""
    return replace(model, gradient_kernel=None)


def _least_squares(
    problem: Problem, start: FloatArray, method: Literal["trf", "dogbox"], analytic: bool
) -> FloatArray:
    from scipy.optimize import least_squares

    span = problem.high - problem.low
    found = least_squares(
        problem.residual,
        start,
        jac=problem.jacobian if analytic else "2-point",
        bounds=(problem.low, problem.high),
        method=method,
        x_scale=span,
    )
    return np.asarray(found.x)


def scan(name: str, truth: dict[str, float], seed: int) -> Problem:
    """A scan of 3 incidences and 33 view angles with noise of half a per cent."""
    theta_i, theta_r = np.repeat([30.0, 45.0, 60.0], 33), np.tile(np.linspace(-80, 80, 33), 3)
    apart = np.abs(theta_i - theta_r) >= 3  # nearer, camera and lamp hide one another
    geometry = Geometry.from_degrees(theta_i=theta_i[apart], theta_r=theta_r[apart])
    true = MODELS[name].brdf(geometry, **truth)
    noise = np.random.default_rng(seed).standard_normal(true.size)
    covariance = Covariance(np.square(NOISE * true), np.zeros((true.size, 0)))
    return Problem(MODELS[name], geometry, true * (1 + NOISE * noise), covariance)


def random_starts(problem: Problem, count: int) -> FloatArray:
    """Starts all over the domain, (count, parameters)."""
    random = np.random.default_rng(11)
    return np.asarray(random.uniform(problem.low, problem.high, (count, problem.low.size)))


@dataclass(frozen=True, slots=True)
class Optimum:
    """The deepest minimum of a scan, and the root of the matrix that measures distances in u."""

    x: FloatArray
    per_u: FloatArray

    def distance_u(self, x: FloatArray) -> float:
        """How far off, in standard uncertainties along the worst direction."""
        if not np.all(np.isfinite(x)):
            return math.inf
        return float(np.linalg.norm(self.per_u @ (x - self.x)))


def optimum(problem: Problem, count: int = 12) -> Optimum:
    """The deepest of many descents, from the grid and from random starts, as far as they go."""
    begin = [*starting_values(problem, _GRID_STARTS), *random_starts(problem, count)]
    ends = [problem.solve(with_scales(problem, x), rtol=_TIGHT) for x in begin]
    best = min(ends, key=lambda m: m.chi2)
    best = problem.solve(best.x, rtol=_TIGHT)
    return Optimum(best.x, np.linalg.qr(problem.jacobian(best.x)).R)


def fit_studies(effort: Effort) -> tuple[Study, Study]:
    """All methods in all scenes: how near they come, and how often they miss."""
    near = _near(effort)
    return near, _misses(near)


def _misses(near: Study) -> Study:
    """The same fits with the part of starts that miss the optimum as the error."""
    name = "fit_misses"
    parts = [t.failures / t.attempts for t in near.trials]
    trials = [
        replace(t, study=name, error=part, error_median=part)
        for t, part in zip(near.trials, parts, strict=True)
    ]
    return Study(
        name,
        "Fit: which solver misses the optimum",
        near.cost_axis,
        "part of the starts that miss it",
        _missed_caption(trials),
        near.truth,
        tuple(trials),
        error_is="part missed",
    )


def _missed_caption(trials: Sequence[Trial]) -> str:
    own = [t for t in trials if t.default]
    hardest = [t for t in trials if t.scene == SCENES[-1][0] and not t.default]
    words = [f"{t.label} {percent(t.error)}" for t in hardest]
    return (
        f"With starts of its own the program misses {sum(t.failures for t in own)} of "
        f"{sum(t.attempts for t in own)} scans.\nFrom random starts all over the domain, with 5 "
        f"parameters, miss: {', '.join(words)}."
    )


def _near(effort: Effort) -> Study:
    name, trials = "fit", list[Trial]()
    for scene, model, truth in SCENES:
        problems = [scan(model, truth, seed) for seed in range(effort.data_sets)]
        best = [optimum(problem) for problem in problems]
        trials += [_trial(name, scene, m, problems, best, effort.starts) for m in methods()]
    return Study(
        name,
        "Fit: solver, derivatives, and linear parameters solved for or searched",
        "time per fit (ms)",
        "distance from the optimum (u), worst",
        _caption(trials),
        f"deepest minimum of many descents; {effort.starts} random starts over the whole domain, "
        f"{effort.data_sets} noisy scans; further off than {MISSED_U:g} u is a miss and not among "
        "the worst",
        tuple(trials),
    )


def _caption(trials: Sequence[Trial]) -> str:
    own = [t for t in trials if t.default]
    others = [t for t in trials if t.peer]
    times = ", ".join(rounded(t.cost) for t in own)
    peers = f"; lmfit takes {', '.join(rounded(t.cost) for t in others)} ms" if others else ""
    return (
        f"The program takes {times} ms with 2, 3 and 5 parameters, its search for a start included"
        f"{peers}.\nWhoever arrives is far nearer than one standard uncertainty: a solver’s worth "
        "shows in its time and in the misses of the next chart, not in its last digits."
    )


def _trial(
    study: str,
    scene: str,
    method: Method,
    problems: list[Problem],
    best: list[Optimum],
    count: int,
) -> Trial:
    begin = random_starts(problems[0], len(problems) if method.own_starts else count)
    seconds, distances = [], []
    method.solve(problems[0], begin[0])  # imports are nobody's cost
    for n, start in enumerate(begin):
        at = n % len(problems)
        begun = time.process_time()
        try:
            x = method.solve(problems[at], start)
        except (ValueError, ArithmeticError, np.linalg.LinAlgError):
            x = np.full_like(start, np.nan)  # a solver that gives up has missed
        seconds.append(time.process_time() - begun)
        distances.append(best[at].distance_u(x))
    off = np.array(distances)
    arrived = off[off <= MISSED_U]
    return Trial(
        study,
        scene,
        method.series,
        method.label,
        1e3 * float(np.median(seconds)),
        float(np.max(arrived, initial=0.0)) if arrived.size else math.inf,
        float(np.median(off)),
        method.default,
        method.peer,
        failures=int(np.sum(off > MISSED_U)),
        attempts=off.size,
        note=method.note,
    )
