"""Torrance and Sparrow's specular lobe: mirrors on the facets of V-cavities.

Sources: K. E. Torrance, E. M. Sparrow, Journal of the Optical Society of America 57 (1967), in
the form of Oren and Nayar 1995, equation (37), with the 1/4 and the irradiance that it leaves to
k_s put back: our ks is a Fresnel factor, theirs divided by 4 is ours.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from analysis.models.base import Model, Parameter
from instrument.geometry import FloatArray, Geometry

KS = Parameter("ks", "1", 0.0, 10.0, 0.1, scale=True)
# A lobe narrower than this is a mirror image of the lamp, which no BRDF describes.
SIGMA_DEG = Parameter("sigma_deg", "degrees", 0.5, 60.0, 20.0)

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)


def torrance_sparrow_brdf(geometry: Geometry, ks: float, sigma_deg: float) -> FloatArray:
    """Torrance and Sparrow's BRDF in 1/sr: ks G P(theta_a) / (4 cos_i cos_r cos_a).

    theta_a is the half-vector's polar angle, P the Gaussian (32) of width `sigma_deg`, and
    G = min(1, 2 cos_a cos_r / cos', 2 cos_a cos_i / cos') the masking and shadowing of V-cavities,
    theta' being the angle from the half-vector to the lamp (or the camera). `ks` is a Fresnel
    factor that does not change with angle. Never negative; reciprocal. It grows without limit
    only where lamp and camera both graze the surface.
    """
    theta_a, cos_a, cos_half = half_vector(geometry)
    cos_i, cos_r = np.cos(geometry.theta_i), np.cos(geometry.theta_r)
    # G over its denominator in one step: a grazing direction then needs no 0/0.
    denominator = np.maximum(4 * cos_i * cos_r * cos_a, 2 * cos_half * np.maximum(cos_i, cos_r))
    return ks * slope_density(theta_a, math.radians(sigma_deg)) / denominator


def half_vector(geometry: Geometry) -> tuple[FloatArray, FloatArray, FloatArray]:
    """theta_a in radians, cos(theta_a) and cos(theta') of the half-vector.

    theta_a is the angle from the sample's normal to the vector half-way between lamp and camera,
    theta' the angle from that vector to either. Arrays of the geometry's shape.
    """
    theta_i, theta_r = geometry.theta_i, geometry.theta_r
    x, y = np.sin(theta_i), np.sin(theta_r)
    # Lamp and camera opposite each other cancel: rounding may leave a square just below zero.
    across2 = np.maximum(x * x + y * y + 2 * x * y * geometry.cos_dphi, 0.0)
    along = np.cos(theta_i) + np.cos(theta_r)
    length = np.sqrt(across2 + along * along)
    return np.arctan2(np.sqrt(across2), along), along / length, length / 2


def slope_density(theta_a: FloatArray, sigma: float) -> FloatArray:
    """Gaussian slope density P(theta_a) in 1/sr, both angles in radians: 1995, equation (32)."""
    return gaussian_normalisation(sigma) * np.exp(-0.5 * np.square(theta_a / sigma))


@lru_cache(maxsize=1024)
def gaussian_normalisation(sigma: float) -> float:
    """The c of equation (32) in 1/sr for sigma in radians: P integrates to 1 over the hemisphere.

    Gauss-Legendre quadrature of 64 points up to 9 sigma (beyond, less than 3e-18 is left): exact
    to about 1e-14 for sigma from 0.5 to 70 degrees.
    """
    end = min(math.pi / 2, 9 * sigma)
    theta = end / 2 * (_NODES + 1)
    integral = end / 2 * np.dot(_WEIGHTS, np.exp(-0.5 * np.square(theta / sigma)) * np.sin(theta))
    return 1 / (2 * math.pi * float(integral))


TORRANCE_SPARROW = Model("torrance_sparrow", (KS, SIGMA_DEG), torrance_sparrow_brdf)
