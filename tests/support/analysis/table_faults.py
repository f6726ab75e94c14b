"""Sound tables drawn at random, with faults to put into them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from analysis.data.measurements import Measurements
from analysis.models import MODELS, Model
from instrument.geometry import FloatArray, Geometry
from tests.support.analysis.random_fits import LOBES, random_case


@dataclass(frozen=True, slots=True)
class Sound:
    """Measurements of a model, the model with its parameters, and the unit of relative values."""

    measurements: Measurements
    model: Model
    values: dict[str, float]
    level: float = 1.0

    def brdf(self, geometry: Geometry) -> FloatArray:
        """True BRDF in 1/sr, or in the unit of the values, of the geometry's shape."""
        return self.level * self.model.brdf(geometry, **self.values)


def sound_table(seed: int) -> Sound:
    """A seeded scan; every second one without u, half of them relative, some with free levels.

    A lobe alone may leave a lamp setting dark, without a level.
    """
    case = random_case(seed)
    m, values = case.measurements, dict(
        zip((p.name for p in case.model.parameters), map(float, case.truth), strict=True)
    )  # fmt: skip
    if seed % 2:
        m = replace(m, u_random=None, u_theta_i_deg=0.0, shared=())
    if seed % 4 < 2:
        return Sound(m, case.model, values)
    level = np.random.default_rng(seed).uniform(0.1, 50)
    free = seed % 8 == 6 and case.model.name not in LOBES
    m = replace(scaled(m, level), relative=True, free_levels=free)
    return Sound(m, case.model, values, level)


def matt_table(
    seed: int, *, stated: bool = True, incidences: int = 2, noise: float = 0.003
) -> Sound:
    """A rough matt sample, half of them with a lobe, over whole sweeps of 5 degrees."""
    rng = np.random.default_rng((7, seed))
    theta_i = np.sort(rng.choice([20.0, 30.0, 40.0, 50.0, 60.0], incidences, replace=False))
    views = np.arange(-75, 75.1, 5)
    i, r = np.repeat(theta_i, views.size), np.tile(views, incidences)
    i, r = i[np.abs(i - r) > 3], r[np.abs(i - r) > 3]
    values = {"albedo": rng.uniform(0.3, 0.9), "sigma_deg": rng.uniform(12.0, 40.0)}
    model = MODELS["oren_nayar"]
    if seed % 2:
        model = MODELS["oren_nayar+torrance_sparrow_lobe"]
        values |= {"ks": rng.uniform(0.02, 0.1), "lobe_sigma_deg": rng.uniform(8.0, 20.0)}
    f = model.brdf(Geometry.from_degrees(theta_i=i, theta_r=r), **values)
    y, u = f * (1 + noise * rng.standard_normal(f.size)), noise * f
    return Sound(Measurements.bare(i, r, 0.0, y, u if stated else None), model, values)


def scaled(m: Measurements, factor: FloatArray | float) -> Measurements:
    """Values and u times a factor, (N,) or one number."""
    u = None if m.u_random is None else m.u_random * factor
    return replace(m, brdf=m.brdf * factor, u_random=u)


def lamp_swapped(m: Measurements) -> Measurements:
    """The sign of theta_r wrong everywhere."""
    return replace(m, theta_r_deg=-m.theta_r_deg)


def bench_errors(m: Measurements, seed: int) -> Measurements:
    """Systematic errors of a bench, smooth in the angles: up to a few %, and glare up to 1 %."""
    rng = np.random.default_rng((8, seed))
    x, z = np.sin(np.radians(m.theta_r_deg)), np.cos(m.geometry.theta_i)
    size = 0.03 * 10 ** rng.uniform(-1, 0)
    error = size * (rng.standard_normal(4) @ np.stack([x, x * x, x * z, z]))
    glare = (
        rng.uniform(0, 0.01) * float(np.mean(m.brdf)) / np.maximum(np.cos(m.geometry.theta_r), 0.1)
    )
    return replace(m, brdf=m.brdf * (1 + error) + glare)


def in_radians(m: Measurements, decimals: int = 4) -> Measurements:
    """All angles in radians, rounded to so many decimals."""
    angles = (m.theta_i_deg, m.theta_r_deg, m.dphi_deg)
    i, r, dphi = (np.round(np.radians(a), decimals) for a in angles)
    return replace(m, theta_i_deg=i, theta_r_deg=r, dphi_deg=dphi)


def with_outliers(m: Measurements, fraction: float, seed: int) -> tuple[Measurements, FloatArray]:
    """A fraction of the points wrong by 10 to 60 %, and their indices (M,)."""
    rng = np.random.default_rng((9, seed))
    points = rng.choice(m.size, max(1, round(fraction * m.size)), replace=False)
    y = m.brdf.copy()
    y[points] *= 1 + rng.uniform(0.1, 0.6, points.size) * rng.choice([-1, 1], points.size)
    return replace(m, brdf=y), points
