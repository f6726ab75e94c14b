"""Torrance and Sparrow's specular lobe: mirrors on the facets of V-cavities.

What to use when: `torrance_sparrow` where one roughness serves the diffuse part too,
`torrance_sparrow_lobe` where the lobe has a width of its own, `torrance_sparrow_full` with a
Fresnel factor, for polarised light, or with another density of facets than the Gaussian.

Sources: K. E. Torrance, E. M. Sparrow, Journal of the Optical Society of America 57 (1967), in
the form of Oren and Nayar 1995, equation (37), with the 1/4 and the irradiance that it leaves to
k_s restored: our ks is a Fresnel factor, theirs divided by 4 is ours. S. K. Nayar, K. Ikeuchi,
T. Kanade, "Surface Reflection: Physical and Geometrical Perspectives", IEEE Transactions on
Pattern Analysis and Machine Intelligence 13 (1991), equations (36)-(50).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from analysis.models.base import Model, Parameter, cached_per_geometry
from analysis.models.validity import valid_unless_both_graze
from instrument.geometry import FloatArray, Geometry

KS = Parameter("ks", "1", 0.0, 10.0, 0.1, scale=True)
# A fit's lobe narrower than this is a mirror image of the lamp: no lens and no scan resolve it.
SIGMA_DEG = Parameter("sigma_deg", "degrees", 0.5, 60.0, 20.0)
LOBE_SIGMA_DEG = replace(SIGMA_DEG, name="lobe_sigma_deg", default=10.0)
# The bare formulas hold for the papers' narrowest lobes, too: 1991, figure 13.
ANY_SIGMA_DEG = replace(SIGMA_DEG, low=0.01)

# Function of an angle in radians: density in 1/sr of a slope theta_a, or reflectance at theta'.
OfAngle = Callable[[FloatArray], FloatArray]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)


def torrance_sparrow_brdf(geometry: Geometry, ks: float, sigma_deg: float) -> FloatArray:
    """Torrance and Sparrow's BRDF: ks G P(theta_a) / (4 cos_i cos_r cos_a).

    Arguments and result as in `Model.brdf`. theta_a is the half-vector's polar angle, P the
    Gaussian (32) of width `sigma_deg`, and G = min(1, 2 cos_a cos_r / cos', 2 cos_a cos_i / cos')
    the masking and shadowing of V-cavities, theta' being the angle from the half-vector to the lamp
    (or the camera). `ks` is a Fresnel factor that is the same at every angle. Never negative;
    reciprocal. It grows without limit only where lamp and camera both graze the surface.
    """
    theta_a = half_vector(geometry)[0]
    P = slope_density(theta_a, math.radians(sigma_deg))
    return ks * P / _denominator(geometry)


def torrance_sparrow_gradient(
    geometry: Geometry, ks: float, sigma_deg: float
) -> dict[str, FloatArray]:
    """Derivatives of `torrance_sparrow_brdf` by ks and by sigma. As in `Model.gradient`.

    d ln P / d sigma = (theta_a^2 - <theta_a^2>) / sigma^3: the mean square slope <theta_a^2> is
    the normalisation's part.
    """
    theta_a = half_vector(geometry)[0]
    sigma = math.radians(sigma_deg)
    unit = slope_density(theta_a, sigma) / _denominator(geometry)
    by_sigma = (np.square(theta_a) - mean_square_slope(sigma)) / sigma**3
    return {"ks": unit, "sigma_deg": ks * unit * by_sigma * math.radians(1.0)}


def torrance_sparrow_lobe_brdf(geometry: Geometry, ks: float, lobe_sigma_deg: float) -> FloatArray:
    """`torrance_sparrow_brdf` with a width that a sum does not share. As in `Model.brdf`."""
    return torrance_sparrow_brdf(geometry, ks, lobe_sigma_deg)


def torrance_sparrow_lobe_gradient(
    geometry: Geometry, ks: float, lobe_sigma_deg: float
) -> dict[str, FloatArray]:
    """Derivatives of `torrance_sparrow_lobe_brdf`. As in `Model.gradient`."""
    by = torrance_sparrow_gradient(geometry, ks, lobe_sigma_deg)
    return {"ks": by["ks"], "lobe_sigma_deg": by["sigma_deg"]}


def torrance_sparrow_full(
    geometry: Geometry, fresnel: OfAngle | FloatArray | float, density: OfAngle | float
) -> FloatArray:
    """BRDF for any facets: 1991 (47) and (48) over L_i dω_i cos_i; 1995 (37). Library only.

    F'(θ') G P(θ_a) / (4 cos_i cos_r cos_a), in 1/sr and of the geometry's shape. `fresnel` is the
    facets' energy reflectance F': a number, an array that broadcasts with the geometry, or a
    function of θ' in radians, such as `fresnel.polarised` with an index, real or complex, and the
    weight h of (42). `density` is P(θ_a) in 1/sr of θ_a in radians, per facet AREA, with ∫ P dω = 1
    over the hemisphere; a number is the width in degrees of the Gaussian (32). The 1991 paper
    counts facets instead: its a_f ρ_α(α) is P / cos_a here. θ' and θ_a are the half-vector's: the
    paper's (39), which uses asin, is ambiguous and unstable.
    """
    theta_a = half_vector(geometry)[0]
    F = fresnel(local_incidence(geometry)) if callable(fresnel) else fresnel
    P = density(theta_a) if callable(density) else gaussian(density)(theta_a)
    return np.asarray(F * P / _denominator(geometry))


def gaussian(sigma_deg: float) -> OfAngle:
    """The Gaussian density (32) of width `sigma_deg` as a function of θ_a in radians."""
    sigma = math.radians(ANY_SIGMA_DEG.check(sigma_deg))
    return lambda theta_a: slope_density(theta_a, sigma)


def attenuation(geometry: Geometry) -> FloatArray:
    """G of V-cavities, 0 to 1, of the geometry's shape: 1991, equation (44). Library only."""
    _, cos_a, cos_half = half_vector(geometry)
    least = np.minimum(np.cos(geometry.theta_i), np.cos(geometry.theta_r))
    G: FloatArray = np.minimum(1.0, 2 * cos_a * least / cos_half)
    return G


def local_incidence(geometry: Geometry) -> FloatArray:
    """θ' in radians, of the geometry's shape: incidence on the mirroring facets, 1991 (38)."""
    _, _, cos_half = half_vector(geometry)
    theta: FloatArray = np.arctan2(np.sqrt(_half_difference2(geometry)), cos_half)
    return theta


@cached_per_geometry
def _denominator(geometry: Geometry) -> FloatArray:
    """4 cos_i cos_r cos_a / G in one step, without 0/0 at grazing."""
    _, cos_a, cos_half = half_vector(geometry)
    cos_i, cos_r = np.cos(geometry.theta_i), np.cos(geometry.theta_r)
    return np.maximum(4 * cos_i * cos_r * cos_a, 2 * cos_half * np.maximum(cos_i, cos_r))


@cached_per_geometry
def half_vector(geometry: Geometry) -> tuple[FloatArray, ...]:
    """theta_a in radians, cos(theta_a) and cos(theta') of the half-vector.

    theta_a is the angle from the sample's normal to the vector half-way between lamp and camera,
    theta' the angle from that vector to either. Arrays of the geometry's shape.
    """
    across2 = tangential_squared(geometry)
    along = np.cos(geometry.theta_i) + np.cos(geometry.theta_r)
    length = np.sqrt(across2 + along * along)
    return np.arctan2(np.sqrt(across2), along), along / length, length / 2


@cached_per_geometry
def tangential_squared(geometry: Geometry) -> FloatArray:
    """Squared length of the tangential part of the sum of the unit vectors to lamp and camera.

    sin²θ_i + sin²θ_r + 2 sinθ_i sinθ_r cos dphi, as a sum of squares: nothing cancels near the
    mirror direction. Dimensionless, of the geometry's shape.
    """
    x, y = np.sin(geometry.theta_i), np.sin(geometry.theta_r)
    cos_half_dphi = np.cos(np.radians(geometry.dphi_deg) / 2)
    return np.asarray(np.square(x - y) + 4 * x * y * np.square(cos_half_dphi))


def _half_difference2(geometry: Geometry) -> FloatArray:
    """sin²θ': a quarter of the square of the difference of the unit vectors."""
    x, y = np.sin(geometry.theta_i), np.sin(geometry.theta_r)
    side2 = np.square(x - y) + 4 * x * y * np.square(np.sin(np.radians(geometry.dphi_deg) / 2))
    up2 = np.square(np.cos(geometry.theta_i) - np.cos(geometry.theta_r))
    return np.asarray((side2 + up2) / 4)


def slope_density(theta_a: FloatArray, sigma: float) -> FloatArray:
    """Gaussian slope density P(theta_a) in 1/sr: 1995, equation (32).

    `theta_a` of any shape, and the standard deviation `sigma`, in radians.
    """
    return gaussian_normalisation(sigma) * np.exp(-0.5 * np.square(theta_a / sigma))


@lru_cache(maxsize=1024)
def gaussian_normalisation(sigma: float) -> float:
    """The c of equation (32) in 1/sr for sigma in radians: P integrates to 1 over the hemisphere.

    Gauss-Legendre quadrature of 64 points up to 9 sigma (less than 3e-18 lies beyond): exact
    to about 1e-14 for sigma from 0.01 to 70 degrees.
    """
    return 1 / (2 * math.pi * _slope_integral(sigma, 0))


@lru_cache(maxsize=1024)
def mean_square_slope(sigma: float) -> float:
    """Mean of theta_a^2 over the density (32), in square radians, for sigma in radians."""
    return _slope_integral(sigma, 2) / _slope_integral(sigma, 0)


def _slope_integral(sigma: float, power: int) -> float:
    """Integral of theta^power exp(-theta^2 / 2 sigma^2) sin(theta) over theta."""
    end = min(math.pi / 2, 9 * sigma)
    theta = end / 2 * (_NODES + 1)
    facets = np.exp(-0.5 * np.square(theta / sigma)) * np.sin(theta)
    return end / 2 * float(np.dot(_WEIGHTS, theta**power * facets))


TORRANCE_SPARROW = Model(
    "torrance_sparrow",
    (KS, SIGMA_DEG),
    torrance_sparrow_brdf,
    torrance_sparrow_gradient,
    valid_unless_both_graze,
)
TORRANCE_SPARROW_LOBE = Model(
    "torrance_sparrow_lobe",
    (KS, LOBE_SIGMA_DEG),
    torrance_sparrow_lobe_brdf,
    torrance_sparrow_lobe_gradient,
    valid_unless_both_graze,
)
