"""Diffuse models: Lambert's, and Oren and Nayar's for V-cavities with Gaussian slopes.

What to use when: `lambert` for a smooth matte surface; `oren_nayar_qualitative` where speed rules
or only the shape of the backscatter matters (forward it can be twice the integral); `oren_nayar`
for measurements (it keeps within about 2 % of the integral over most of the plane of incidence).

Source: M. Oren, S. K. Nayar, "Generalization of the Lambertian Model and Implications for Machine
Vision", International Journal of Computer Vision 14 (1995), sections 4.3 and 4.4.
"""

from __future__ import annotations

import math

import numpy as np

from analysis.models.base import Model, Parameter
from instrument.geometry import FloatArray, Geometry

ALBEDO = Parameter("albedo", "1", 0.0, 1.0, 0.5, scale=True)
SIGMA_DEG = Parameter("sigma_deg", "degrees", 0.0, 60.0, 20.0)


def lambert_brdf(geometry: Geometry, albedo: float) -> FloatArray:
    """Lambert's BRDF in 1/sr: albedo / pi, the same in every direction."""
    return np.full(geometry.shape, albedo / np.pi)


def oren_nayar_qualitative_brdf(geometry: Geometry, albedo: float, sigma_deg: float) -> FloatArray:
    """Oren and Nayar's qualitative BRDF in 1/sr: 1995, equation (36), over E0 cos(theta_i).

    `sigma_deg` is the standard deviation of the facets' slope angle. No masking of the far slope,
    no interreflection. Never negative; reciprocal; Lambert's at sigma = 0. As printed it grows
    without limit where lamp and camera both graze the surface on one side (tan beta).
    """
    sigma2 = math.radians(sigma_deg) ** 2
    A = 1 - 0.5 * sigma2 / (sigma2 + 0.33)
    B = 0.45 * sigma2 / (sigma2 + 0.09)
    alpha, beta = _larger_and_smaller(geometry)
    return (albedo / np.pi) * (
        A + B * np.maximum(0.0, geometry.cos_dphi) * np.sin(alpha) * np.tan(beta)
    )


def oren_nayar_brdf(geometry: Geometry, albedo: float, sigma_deg: float) -> FloatArray:
    """Oren and Nayar's functional BRDF in 1/sr: 1995, equations (33) + (34), over E0 cos(theta_i).

    `sigma_deg` is the standard deviation of the facets' slope angle. Direct light (33) and light
    of two bounces (34), both fitted by their authors to numerical integrals. Reciprocal;
    Lambert's at sigma = 0. As printed it is negative far forward at high roughness (60 degrees,
    from 77/77 degrees on), and grows without limit where lamp and camera both graze the surface.
    """
    sigma2 = math.radians(sigma_deg) ** 2
    cos_dphi = geometry.cos_dphi
    alpha, beta = _larger_and_smaller(geometry)
    b = beta * (2 / np.pi)
    rough = sigma2 / (sigma2 + 0.09)
    C1 = 1 - 0.5 * sigma2 / (sigma2 + 0.33)
    C2 = 0.45 * rough * (np.sin(alpha) - np.where(cos_dphi >= 0, 0.0, b * b * b))
    C3 = 0.125 * rough * np.square(alpha * b * (2 / np.pi))
    direct = (
        C1 + cos_dphi * C2 * np.tan(beta) + (1 - np.abs(cos_dphi)) * C3 * np.tan((alpha + beta) / 2)
    )
    twice = 0.17 * albedo * sigma2 / (sigma2 + 0.13) * (1 - cos_dphi * (b * b))
    return (albedo / np.pi) * (direct + twice)


def _larger_and_smaller(geometry: Geometry) -> tuple[FloatArray, FloatArray]:
    """The paper's alpha = max(theta_r, theta_i) and beta = min(theta_r, theta_i), in radians."""
    theta_i, theta_r = geometry.theta_i, geometry.theta_r
    return np.maximum(theta_i, theta_r), np.minimum(theta_i, theta_r)


LAMBERT = Model("lambert", (ALBEDO,), lambert_brdf)
OREN_NAYAR_QUALITATIVE = Model(
    "oren_nayar_qualitative", (ALBEDO, SIGMA_DEG), oren_nayar_qualitative_brdf
)
OREN_NAYAR = Model("oren_nayar", (ALBEDO, SIGMA_DEG), oren_nayar_brdf)
