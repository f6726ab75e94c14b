"""EON: the energy-preserving Oren-Nayar model of computer graphics.

What to use when: a rough matte surface that must conserve energy: at albedo 1 it reflects all light
from every direction, which none of the papers' closed forms does.

Source: J. Portsmouth, P. Kutz, S. Hill, "EON: A Practical Energy-Preserving Rough Diffuse BRDF",
Journal of Computer Graphics Techniques 14 (2025), arXiv 2410.18026 (2024); its single-scattering
part is Y. Fujii's (FON, 2013).
"""

from __future__ import annotations

import math

import numpy as np

from analysis.models.base import Model, Parameter, Validity, cached_per_geometry
from analysis.models.lambert import ALBEDO
from analysis.models.validity import GRAZING, both_graze, valid_except
from instrument.geometry import FloatArray, Geometry

ROUGHNESS = Parameter("roughness", "1", 0.0, 1.0, 0.3)

_C1 = 1 / 2 - 2 / (3 * math.pi)
_C2 = 2 / 3 - 28 / (15 * math.pi)


def eon_brdf(geometry: Geometry, albedo: float, roughness: float) -> FloatArray:
    """EON BRDF: f_ss + f_ms of `albedo` (rho) and `roughness` (r). As in `Model.brdf`.

    f_ss = (rho/pi) A (1 + r s/t), A = 1/(1 + c1 r), c1 = 1/2 - 2/(3 pi),
    s = cos(dphi) sin_i sin_r, t = max(cos_i, cos_r) for s > 0, else 1;
    f_ms = (rho_ms/pi) (1 - E_i)(1 - E_r)/(1 - E), rho_ms = rho^2 E/(1 - rho (1 - E)), where E_i,
    E_r are the directional and E the mean albedos of f_ss at rho = 1. Written with
    1 - E_i = A r g_i and 1 - E = A r (c1 - c2), c2 = 2/3 - 28/(15 pi), which avoids 0/0 at r = 0.

    Never negative; reciprocal; Lambert's at r = 0; reflects all light at rho = 1. It grows without
    limit only where lamp and camera both graze the surface on one side.
    """
    A = 1 / (1 + _C1 * roughness)
    single = A * (1 + roughness * _s_over_t(geometry))
    rho_ms, _, _ = _multiple_albedo(albedo, roughness)
    multiple = rho_ms * A * roughness * _shape(geometry)
    return np.asarray((albedo * single + multiple) / np.pi)


def eon_gradient(geometry: Geometry, albedo: float, roughness: float) -> dict[str, FloatArray]:
    """Derivatives of `eon_brdf` by albedo and by roughness. As in `Model.gradient`."""
    A = 1 / (1 + _C1 * roughness)
    s_over_t, shape = _s_over_t(geometry), _shape(geometry)
    rho_ms, by_albedo, by_E = _multiple_albedo(albedo, roughness)
    # dA/dr = -c1 A^2, d(A r)/dr = A^2, dE/dr = -(c1 - c2) A^2
    d_single = A * A * (s_over_t - _C1)
    d_multiple = A * A * (rho_ms - by_E * (_C1 - _C2) * A * roughness) * shape
    return {
        "albedo": (A * (1 + roughness * s_over_t) + by_albedo * A * roughness * shape) / np.pi,
        "roughness": (albedo * d_single + d_multiple) / np.pi,
    }


def eon_validity(geometry: Geometry, albedo: float, roughness: float) -> Validity:
    """Valid unless lamp and camera both graze on one side. Arguments as in `Model.brdf`."""
    diverges = both_graze(geometry) & (geometry.cos_dphi > 0) & (albedo * roughness > 0)
    return valid_except(geometry, (diverges, GRAZING))


def directional_albedo(theta: FloatArray, roughness: float) -> FloatArray:
    """E_i = A (1 + r G/pi): fraction of the light from theta that f_ss reflects at rho = 1.

    `theta` in radians, any shape, which is the result's. Library only.
    """
    return np.asarray(1 - roughness * _loss(theta) / (1 + _C1 * roughness))


def _multiple_albedo(albedo: float, roughness: float) -> tuple[float, float, float]:
    """rho_ms, and its derivatives by rho and by E."""
    E = (1 + _C2 * roughness) / (1 + _C1 * roughness)
    rest = 1 - albedo * (1 - E)
    by_albedo = albedo * E * (2 - albedo * (1 - E)) / rest**2
    return albedo**2 * E / rest, by_albedo, albedo**2 * (1 - albedo) / rest**2


@cached_per_geometry
def _s_over_t(geometry: Geometry) -> FloatArray:
    theta_i, theta_r = geometry.theta_i, geometry.theta_r
    s = geometry.cos_dphi * np.sin(theta_i) * np.sin(theta_r)
    t = np.where(s > 0, np.cos(np.minimum(theta_i, theta_r)), 1.0)
    # Rounding must not make 1 + r s/t negative at the horizon.
    return np.asarray(np.maximum(s / t, -1.0))


@cached_per_geometry
def _shape(geometry: Geometry) -> FloatArray:
    """(1 - E_i)(1 - E_r)/(1 - E) over A r."""
    return np.asarray(_loss(geometry.theta_i) * _loss(geometry.theta_r) / (_C1 - _C2))


def _loss(theta: FloatArray) -> FloatArray:
    """g = c1 - G/pi >= 0, with the paper's G(theta), 0 at 90 degrees.

    G = sin (theta - sin cos) + (2/3) (tan (1 - sin^3) - sin), and
    tan (1 - sin^3) = sin cos (1 + sin + sin^2)/(1 + sin), which has no infinity.
    """
    S, C = np.sin(theta), np.cos(theta)
    G = S * (theta - S * C) + (2 / 3) * (S * C * (1 + S + S * S) / (1 + S) - S)
    return np.asarray(np.maximum(_C1 - G / np.pi, 0.0))


EON = Model("eon", (ALBEDO, ROUGHNESS), eon_brdf, eon_gradient, eon_validity)
