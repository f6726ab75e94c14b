"""Hemispherical reflectance of a model, for tests of energy conservation."""

from __future__ import annotations

import numpy as np

from analysis.models import MODELS
from instrument.geometry import Geometry


def hemispherical_reflectance(
    name: str, theta_i_deg: float, *, nodes: int = 200, azimuths: int = 180, **parameters: float
) -> float:
    """Reflected fraction: Gauss-Legendre in theta, half-step trapezoid over half the azimuths."""
    t, w = np.polynomial.legendre.leggauss(nodes)
    theta, weight = np.pi / 4 * (t + 1), np.pi / 4 * w
    geometry = Geometry.from_degrees(
        theta_i=theta_i_deg,
        theta_r=np.degrees(theta)[:, np.newaxis],
        dphi=(np.arange(azimuths) + 0.5) * 180 / azimuths,
    )
    mean = MODELS[name].brdf(geometry, **parameters).mean(axis=1)
    return float(2 * np.pi * mean @ (weight * np.sin(theta) * np.cos(theta)))
