"""Reference of the fit methods: noisy scans of known samples and the optimum of each.

The optimum of a scan is the deepest minimum of many descents with the tightest tolerance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from analysis.data.covariance import Covariance
from analysis.fit.search.problem import Problem
from analysis.fit.search.starting_values import bounded_least_squares, starting_values
from analysis.models import MODELS
from instrument.geometry import FloatArray, Geometry

NOISE = 0.005  # relative, of a point
_GRID_STARTS = 3  # the program's own, of each scan
_TIGHT = 1e-15


class Scene(NamedTuple):
    """Name, model and true parameters of a sample."""

    name: str
    model: str
    truth: dict[str, float]


SCENES = (
    Scene("matte: 2 parameters", "oren_nayar", {"albedo": 0.8, "sigma_deg": 25.0}),
    Scene(
        "matte and glossy: 3 parameters",
        "oren_nayar+torrance_sparrow",
        {"albedo": 0.8, "sigma_deg": 20.0, "ks": 0.076},
    ),
    Scene(
        "layered and glossy: 5 parameters",
        "lambert+ggx+single_scattering",
        {"albedo": 0.5, "f0": 0.05, "alpha": 0.25, "scattering": 0.4, "asymmetry": -0.4},
    ),
)


def noisy_scan(scene: Scene, seed: int) -> Problem:
    """Return a scan of 3 incidences and 33 view angles with 0.5 % noise."""
    theta_i, theta_r = np.repeat([30.0, 45.0, 60.0], 33), np.tile(np.linspace(-80, 80, 33), 3)
    apart = np.abs(theta_i - theta_r) >= 3  # closer, camera and lamp block each other
    geometry = Geometry.from_degrees(theta_i=theta_i[apart], theta_r=theta_r[apart])
    model = MODELS[scene.model]
    true = model.brdf(geometry, **scene.truth)
    noise = np.random.default_rng(seed).standard_normal(true.size)
    covariance = Covariance(np.square(NOISE * true), np.zeros((true.size, 0)))
    return Problem(model, geometry, true * (1 + NOISE * noise), covariance)


def random_starts(problem: Problem, count: int) -> FloatArray:
    """Return starts over the whole domain, (count, parameters), in the parameters' units."""
    random = np.random.default_rng(11)
    return np.asarray(random.uniform(problem.low, problem.high, (count, problem.low.size)))


def with_scales(problem: Problem, start: FloatArray) -> FloatArray:
    """Return the start, (parameters,) in their units, with its scales by linear least squares.

    The scales stay within their bounds; the other parameters stay as they are.
    """
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


@dataclass(frozen=True, slots=True)
class Optimum:
    """Deepest minimum `x` of a scan; `per_u` maps differences from it to units of u."""

    x: FloatArray
    per_u: FloatArray

    def distance_u(self, x: FloatArray) -> float:
        """Return the distance of `x`, (parameters,) in their units, in standard uncertainties."""
        if not np.all(np.isfinite(x)):
            return math.inf
        return float(np.linalg.norm(self.per_u @ (x - self.x)))


def optimum(problem: Problem, count: int = 12) -> Optimum:
    """Return the deepest minimum of descents from the grid and from `count` random starts."""
    begin = [*starting_values(problem, _GRID_STARTS), *random_starts(problem, count)]
    ends = [problem.solve(with_scales(problem, x), rtol=_TIGHT) for x in begin]
    best = min(ends, key=lambda m: m.chi2)
    best = problem.solve(best.x, rtol=_TIGHT)
    return Optimum(best.x, np.linalg.qr(problem.jacobian(best.x)).R)
