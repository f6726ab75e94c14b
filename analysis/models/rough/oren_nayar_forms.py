"""Printed formulas of Oren and Nayar for rough diffuse surfaces: (33) + (34), and (36).

What to use when: `oren_nayar_brdf` for measurements (within about 2 % of the integral over most of
the plane of incidence); `oren_nayar_qualitative_brdf` where speed rules or only the shape of the
backscatter matters (forward it can be twice the integral). `oren_nayar` makes the models of them
and says where they are valid.

Source: M. Oren, S. K. Nayar, "Generalization of the Lambertian Model and Implications for Machine
Vision", International Journal of Computer Vision 14 (1995), section 4.4: V-cavities with Gaussian
slopes.
"""

from __future__ import annotations

import math

import numpy as np

from analysis.models.base import Parameter, cached_per_geometry
from instrument.geometry import FloatArray, Geometry

SIGMA_DEG = Parameter("sigma_deg", "degrees", 0.0, 60.0, 20.0)

PRINTED = 0.33
"""The constant of C1 in (36): footnote 11 has another."""


def oren_nayar_qualitative_brdf(
    geometry: Geometry, albedo: float, sigma_deg: float, constant: float = PRINTED
) -> FloatArray:
    """Oren and Nayar's qualitative BRDF: 1995, equation (36), over E0 cos(theta_i).

    Arguments and result as in `Model.brdf`. `sigma_deg` is the standard deviation of the facets'
    slope angle. No masking of the far slope, no interreflection; a `constant` of 0.57 partly makes
    up for the latter (footnote 11). Never negative; reciprocal; Lambert's at sigma = 0. At albedo 1
    it reflects up to 1.015 of the light (sigma 11 degrees, grazing incidence). As printed it grows
    without limit where lamp and camera both graze the surface on one side (tan beta).
    """
    sigma2 = math.radians(sigma_deg) ** 2
    A = 1 - 0.5 * sigma2 / (sigma2 + constant)
    B = 0.45 * sigma2 / (sigma2 + 0.09)
    return (albedo / np.pi) * (A + B * _backward_lobe(geometry))


def oren_nayar_qualitative_gradient(
    geometry: Geometry, albedo: float, sigma_deg: float, constant: float = PRINTED
) -> dict[str, FloatArray]:
    """Derivatives of `oren_nayar_qualitative_brdf` by albedo and sigma. As in `Model.gradient`."""
    sigma = math.radians(sigma_deg)
    lobe = _backward_lobe(geometry)
    dA, dB = -0.5 * _saturation_gradient(sigma, constant), 0.45 * _saturation_gradient(sigma, 0.09)
    return {
        "albedo": oren_nayar_qualitative_brdf(geometry, 1.0, sigma_deg, constant),
        "sigma_deg": (albedo / np.pi) * (dA + dB * lobe),
    }


def oren_nayar_brdf(geometry: Geometry, albedo: float, sigma_deg: float) -> FloatArray:
    """Oren and Nayar's functional BRDF: 1995, equations (33) + (34), over E0 cos(theta_i).

    Arguments and result as in `Model.brdf`. `sigma_deg` is the standard deviation of the facets'
    slope angle. Direct light (33) and light of two bounces (34), both fitted by their authors to
    numerical integrals. Reciprocal; Lambert's at sigma = 0. At albedo 1 it reflects up to 1.051 of
    the light (sigma 17 degrees, grazing incidence; 1.013 up to 75 degrees). As printed it is
    negative far forward at high roughness (60 degrees, from 77/77 degrees on), and grows without
    limit where lamp and camera both graze the surface.
    """
    return (albedo / np.pi) * relative_to_lambert(geometry, albedo, sigma_deg)


def relative_to_lambert(geometry: Geometry, albedo: float, sigma_deg: float) -> FloatArray:
    """Ratio of `oren_nayar_brdf` to albedo / pi. Arguments as in `Model.brdf`."""
    sigma2 = math.radians(sigma_deg) ** 2
    C1 = 1 - 0.5 * sigma2 / (sigma2 + 0.33)
    direct = C1 + sigma2 / (sigma2 + 0.09) * roughness_terms(geometry)
    twice = 0.17 * albedo * sigma2 / (sigma2 + 0.13) * _second_bounce(geometry)
    return np.asarray(direct + twice)


def oren_nayar_gradient(
    geometry: Geometry, albedo: float, sigma_deg: float
) -> dict[str, FloatArray]:
    """Derivatives of `oren_nayar_brdf` by albedo and sigma. As in `Model.gradient`."""
    sigma = math.radians(sigma_deg)
    bounce = 0.17 * _second_bounce(geometry)
    dC1, d_rough = sigma_terms_gradient(sigma_deg)
    d_direct = dC1 + d_rough * roughness_terms(geometry)
    d_twice = albedo * _saturation_gradient(sigma, 0.13) * bounce
    once_more = albedo * sigma**2 / (sigma**2 + 0.13) * bounce  # (34) has albedo squared
    return {
        "albedo": (relative_to_lambert(geometry, albedo, sigma_deg) + once_more) / np.pi,
        "sigma_deg": (albedo / np.pi) * (d_direct + d_twice),
    }


@cached_per_geometry
def roughness_terms(geometry: Geometry) -> FloatArray:
    """Factor of sigma^2 / (sigma^2 + 0.09) in (33): its terms of C2 and C3.

    cos(dphi) C2 tan(beta) + (1 - |cos(dphi)|) C3 tan((alpha + beta)/2), where b = 2 beta/pi,
    C2 = 0.45 (sin(alpha) - [cos(dphi) < 0] b^3) and C3 = 0.125 (4 alpha beta / pi^2)^2.
    Dimensionless, of the geometry's shape.
    """
    cos_dphi = geometry.cos_dphi
    alpha, beta = _larger_and_smaller(geometry)
    b = beta * (2 / np.pi)
    C2 = 0.45 * (np.sin(alpha) - np.where(cos_dphi >= 0, 0.0, b * b * b))
    C3 = 0.125 * np.square(alpha * b * (2 / np.pi))
    result: FloatArray = cos_dphi * C2 * np.tan(beta)
    result += (1 - np.abs(cos_dphi)) * C3 * np.tan((alpha + beta) / 2)
    return result


def sigma_terms_gradient(sigma_deg: float) -> tuple[float, float]:
    """Derivatives in 1/degree of C1 and of the sigma^2 / (sigma^2 + 0.09) of C2 and C3."""
    sigma = math.radians(sigma_deg)
    return -0.5 * _saturation_gradient(sigma, 0.33), _saturation_gradient(sigma, 0.09)


@cached_per_geometry
def _backward_lobe(geometry: Geometry) -> FloatArray:
    """max(0, cos(dphi)) sin(alpha) tan(beta) of (36)."""
    alpha, beta = _larger_and_smaller(geometry)
    return np.asarray(np.maximum(0.0, geometry.cos_dphi) * np.sin(alpha) * np.tan(beta))


@cached_per_geometry
def _second_bounce(geometry: Geometry) -> FloatArray:
    """1 - cos(dphi) (2 beta/pi)^2 of (34)."""
    _, beta = _larger_and_smaller(geometry)
    return np.asarray(1 - geometry.cos_dphi * np.square(beta * (2 / np.pi)))


def _saturation_gradient(sigma: float, constant: float) -> float:
    """Derivative of sigma^2 / (sigma^2 + constant), sigma in radians, per degree."""
    return math.radians(2 * sigma * constant / (sigma * sigma + constant) ** 2)


def _larger_and_smaller(geometry: Geometry) -> tuple[FloatArray, FloatArray]:
    """The paper's alpha = max(theta_r, theta_i) and beta = min(theta_r, theta_i), in radians."""
    theta_i, theta_r = geometry.theta_i, geometry.theta_r
    return np.maximum(theta_i, theta_r), np.minimum(theta_i, theta_r)
