"""Identifiability of a model's parameters from a planned sweep, by a condition number.

What to use when: `condition` to judge a planned sweep for a model at likely values; above LIMIT a
fit will not determine all parameters, and reports "not identifiable".

The condition number is that of the Jacobian of ln(brdf) by the parameters, each in units of its
domain: the largest singular value over the smallest. The largest is near sqrt(N) for N points (a
scale over its domain), so that points of 1 % each leave the worst combination of parameters
uncertain by about condition / (100 sqrt(N)) of a domain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from analysis.models import MODELS
from instrument.geometry import FloatArray, Geometry

LIMIT = 200.0
"""With 61 points of 1 % the worst combination is then uncertain by a quarter of a domain, and its
95 % interval covers the domain."""


def condition(name: str, geometry: Geometry, values: Mapping[str, float]) -> float:
    """Condition number of a model's scaled Jacobian; infinite where a parameter has no effect.

    `geometry` of any shape; `values` are scalars in the units of the parameters. Raises
    `ValueError` as the model does.
    """
    model = MODELS[name]
    gradient = model.gradient(geometry, **values)
    brdf = model.brdf(geometry, **values)
    columns = [gradient[p.name].ravel() * (p.high - p.low) for p in model.parameters]
    positive = brdf.ravel() > 0
    J = np.stack(columns, axis=1)[positive] / brdf.ravel()[positive, None]
    if J.shape[0] < J.shape[1]:
        return np.inf
    singular = np.linalg.svd(J, compute_uv=False)
    return float(singular[0] / singular[-1]) if singular[-1] > 0 else np.inf


def sweep(
    theta_i_deg: Sequence[float], largest_deg: float, dphi_deg: float, points: int = 61
) -> Geometry:
    """Standard sweep, shape (incidences, points): theta_r from -largest to largest, in degrees."""
    theta_r = np.linspace(-largest_deg, largest_deg, points)
    theta_i = np.asarray(theta_i_deg, dtype=np.float64)[:, None]
    return Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi_deg)


def condition_map(
    name: str,
    values: Mapping[str, float],
    theta_i_deg: Sequence[float],
    dphi_deg: float,
    sigma_deg: FloatArray,
    largest_deg: FloatArray,
) -> FloatArray:
    """`condition` of standard sweeps over roughness and their largest view angle, (sigma, largest).

    Angles in degrees. `values`: the other parameters. The points are shared among the incidences,
    61 in all.
    """
    points = max(61 // len(theta_i_deg), 3)
    sweeps = [sweep(theta_i_deg, float(end), dphi_deg, points) for end in largest_deg]
    return np.array(
        [
            [condition(name, s, {**values, "sigma_deg": float(sigma)}) for s in sweeps]
            for sigma in sigma_deg
        ]
    )
