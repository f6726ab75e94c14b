"""Cells of a simulated sample: curves of a model with noise, each with parameters of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.models import MODELS
from instrument.geometry import FloatArray, Geometry


@dataclass(frozen=True, slots=True)
class Cells:
    """Curves (K, C) in 1/sr with their variance, at geometries (K,), and true parameters (C,)."""

    model: str
    geometry: Geometry
    brdf: FloatArray
    variance: FloatArray
    truth: dict[str, FloatArray]


def random_cells(
    seed: int, model: str, count: int, incidences: tuple[float, ...] = (30.0, 60.0)
) -> Cells:
    """Draw views in the plane of incidence, `count` cells, and a noise of 0.2 to 3 %."""
    random = np.random.default_rng(seed)
    views = np.linspace(-75.0, 75.0, int(random.integers(12, 30)))
    theta_i, theta_r = (a.ravel() for a in np.meshgrid(incidences, views, indexing="ij"))
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r)
    truth = {"albedo": random.uniform(0.1, 0.9, count), "sigma_deg": random.uniform(3, 50, count)}
    if "torrance_sparrow" in model:
        truth["ks"] = random.uniform(0.01, 0.2, count)
    curves = [
        MODELS[model].brdf(geometry, **{name: float(v[c]) for name, v in truth.items()})
        for c in range(count)
    ]
    brdf = np.stack(curves, axis=1)
    u = 10 ** random.uniform(-2.7, -1.5) * brdf
    return Cells(model, geometry, brdf + u * random.standard_normal(u.shape), u**2, truth)
