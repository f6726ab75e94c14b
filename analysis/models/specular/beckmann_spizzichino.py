"""Beckmann and Spizzichino's physical optics: lobe and coherent spike of a random height field.

What to use when: `lobe_brdf` (the model `beckmann_spizzichino`) for any roughness;
`smooth_lobe_brdf` and `rough_lobe_brdf` are the paper's limits, to compare with. `spike_brdf` is
the mirror reflection that remains; `surface_statistics` says which of the two dominates.

Lengths (`sigma_h`, `correlation_length`, footprints) are in wavelengths, so that k = 2π. The
surface is a perfect conductor; nothing masks or shadows; light bounces once.

Source: S. K. Nayar, K. Ikeuchi, T. Kanade, "Surface Reflection: Physical and Geometrical
Perspectives", IEEE Transactions on Pattern Analysis and Machine Intelligence 13 (1991), equations
(16)-(22) and (77)-(80), with cosφ_r of the paper = -cos dphi. Its powers and radiances, (18) to
(29), (52) and (53), are in `scattered_power`.
"""

from __future__ import annotations

import math

import numpy as np

from analysis.models.base import Model, Parameter, Validity, last_per_geometry
from analysis.models.specular.poisson_sums import Terms, poisson_terms, summed
from analysis.models.specular.surface_statistics import (
    check_lengths,
    curvature_radius,
    unshadowed_deg,
)
from analysis.models.specular.torrance_sparrow import tangential_squared
from analysis.models.validity import either_grazes, valid_except
from instrument.geometry import FloatArray, Geometry

SCALE = Parameter("scale", "1", 0.0, 10.0, 0.1, scale=True)
# Both lengths matter by their ratio to the wavelength: a fit tries decades, and between them.
SIGMA_H = Parameter(
    "sigma_h",
    "wavelengths",
    0.0,
    100.0,
    0.5,
    starts=(0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 80.0),
    logarithmic=True,
)
CORRELATION_LENGTH = Parameter(
    "correlation_length", "wavelengths", 0.1, 1000.0, 10.0,
    starts=(0.3, 0.55, 1.0, 1.7, 3.0, 5.5, 10.0, 17.0, 30.0, 55.0, 100.0, 200.0, 400.0),
    logarithmic=True,
)  # fmt: skip

K = 2 * math.pi  # the propagation constant (64), in 1/wavelength


def lobe_brdf(
    geometry: Geometry, scale: float, sigma_h: float, correlation_length: float
) -> FloatArray:
    """The lobe for any roughness: 1991, (77) over (80), scale f. As in `Model.brdf`, with

    f = (cosθ_i/cosθ_r) π T² D² e^{-g} Σ_{m≥1} g^m/(m! m) e^{-v_xy² T²/4m}.

    Never negative; reciprocal, as D holds a 1/cosθ_i. Accurate to 1e-9 (found: 3e-11) down to
    1e-280/sr, for g from 0 to 1.6e6, at a cost that does not grow with g. Lobe and spike of a
    surface with a long correlation length reflect 1 - e^{-g} and e^{-g} of the light, times
    `scale`. Diverges as
    1/cosθ at grazing, as printed.
    """
    terms = _terms(geometry, sigma_h, correlation_length)
    lobe = summed(terms, _per_m, geometry.shape)
    return scale * lobe_factor(geometry, correlation_length) * lobe


def lobe_gradient(
    geometry: Geometry, scale: float, sigma_h: float, correlation_length: float
) -> dict[str, FloatArray]:
    """Derivatives of `lobe_brdf` by its parameters, sums over m again. As in `Model.gradient`."""
    terms = _terms(geometry, sigma_h, correlation_length)
    factor = lobe_factor(geometry, correlation_length)
    lobe, by_ln_g, by_ln_t2 = (
        summed(terms, weight, geometry.shape) for weight in (_per_m, _by_ln_g, _by_ln_t2)
    )
    per_sigma = scale * 2 / sigma_h if sigma_h > 1e-150 else 0.0  # f rises as sigma_h^2
    return {
        "scale": factor * lobe,
        "sigma_h": per_sigma * factor * by_ln_g,
        "correlation_length": scale * 2 / correlation_length * factor * by_ln_t2,
    }


@last_per_geometry
def _terms(geometry: Geometry, sigma_h: float, correlation_length: float) -> tuple[Terms, ...]:
    """Terms of the lobe's sum: a fit asks for the lobe and then for its derivatives there."""
    g, q = optical_roughness(geometry, sigma_h), lobe_exponent(geometry, correlation_length)
    return tuple(poisson_terms(g, q))


def lobe_validity(
    geometry: Geometry, scale: float, sigma_h: float, correlation_length: float
) -> Validity:
    """Valid where shadowing is negligible and the radius of curvature exceeds a wavelength.

    Arguments as in `Model.brdf`.
    """
    del scale
    limit_deg = unshadowed_deg(sigma_h, correlation_length)
    larger_deg = np.maximum(geometry.theta_i_deg, geometry.theta_r_deg)
    shadowed = (
        f"beyond {limit_deg:.3g} degrees facets are shadowed or masked, which the model leaves "
        "out; at grazing its 1/cosθ diverges"
    )
    curved = "the surface's radius of curvature is below a wavelength (Kirchhoff)"
    return valid_except(
        geometry,
        ((larger_deg > limit_deg) | either_grazes(geometry), shadowed),
        (curvature_radius(sigma_h, correlation_length) < 1, curved),
    )


def smooth_lobe_brdf(
    geometry: Geometry, scale: float, sigma_h: float, correlation_length: float
) -> FloatArray:
    """The lobe for g ≪ 1: 1991, (78) over (80), first term of the sum. As in `Model.brdf`."""
    g, q = optical_roughness(geometry, sigma_h), lobe_exponent(geometry, correlation_length)
    with np.errstate(under="ignore"):
        return scale * lobe_factor(geometry, correlation_length) * g * np.exp(-g - q)


def rough_lobe_brdf(
    geometry: Geometry, scale: float, sigma_h: float, correlation_length: float
) -> FloatArray:
    """The lobe for g ≫ 1: 1991, (79) over (80), `sigma_h` above 0. As in `Model.brdf`.

    With tan α₀ = 2σ_h/T it is geometrical optics: scale P/(4 cosθ_i cosθ_r), P the density
    exp(-tan²α/tan²α₀)/(π tan²α₀ cos⁴α) of mirrors, so that `scale` is a Fresnel factor.
    """
    if sigma_h < 1e-100:  # its square is 1/0
        raise ValueError(f"sigma_h = {sigma_h:g} wavelengths; allowed: 1e-100 or more where g ≫ 1")
    g, q = optical_roughness(geometry, sigma_h), lobe_exponent(geometry, correlation_length)
    with np.errstate(under="ignore"):
        return scale * lobe_factor(geometry, correlation_length) * np.exp(-q / g) / g


def spike_brdf(
    geometry: Geometry,
    scale: float,
    sigma_h: float,
    X: FloatArray | float,
    Y: FloatArray | float,
) -> FloatArray:
    """The coherent spike: 1991, first term of (77) over (80), scale f. As in `Model.brdf`, with

    f = (cosθ_i/cosθ_r) A e^{-g} ρ₀², A = 4XY the area imaged by the pixel (`patch_of_pixel`).

    `X`, `Y` are half its sides in wavelengths, X in the plane of incidence. Reciprocal in the
    mirror direction only: cosθ_i/cosθ_r is not. In all it reflects scale e^{-g} of the light.
    """
    ratio = np.cos(geometry.theta_i) / np.cos(geometry.theta_r)
    return scale * ratio * 4 * X * Y * _coherent(geometry, sigma_h, X, Y)


def optical_roughness(geometry: Geometry, sigma_h: float) -> FloatArray:
    """g, dimensionless, of the geometry's shape: 1991, equation (19)."""
    check_lengths(sigma_h)
    return np.square(K * sigma_h * (np.cos(geometry.theta_i) + np.cos(geometry.theta_r)))


def wave_vector(geometry: Geometry) -> tuple[FloatArray, FloatArray, FloatArray]:
    """v_x, v_y, v_z in 1/wavelength, of the geometry's shape: 1991, (16), garbled in the scan.

    v = k (sinθ_i - sinθ_r cosφ_r, sinθ_r sinφ_r, -cosθ_i - cosθ_r). v_x is written so that nothing
    cancels near the mirror direction.
    """
    x, y = np.sin(geometry.theta_i), np.sin(geometry.theta_r)
    half = np.radians(geometry.dphi_deg) / 2
    v_x = K * (x - y + 2 * y * np.square(np.cos(half)))
    v_y = -K * y * 2 * np.sin(half) * np.cos(half)
    return v_x, v_y, -K * (np.cos(geometry.theta_i) + np.cos(geometry.theta_r))


def geometric_factor(geometry: Geometry) -> FloatArray:
    """D: 1991, (21), with 1 + cosθ_i cosθ_r - sinθ_i sinθ_r cosφ_r = v²/2k².

    Dimensionless, of the geometry's shape.
    """
    cos_i = np.cos(geometry.theta_i)
    along = cos_i + np.cos(geometry.theta_r)
    return np.asarray((tangential_squared(geometry) + along * along) / (2 * cos_i * along))


def lobe_exponent(geometry: Geometry, correlation_length: float) -> FloatArray:
    """q = v_xy² T²/4, dimensionless, of the geometry's shape: a term of the sum has e^{-q/m}."""
    check_lengths(0.0, correlation_length)
    return (K * correlation_length) ** 2 / 4 * tangential_squared(geometry)


def lobe_factor(geometry: Geometry, correlation_length: float) -> FloatArray:
    """(cosθ_i/cosθ_r) π T² D² in 1/sr, of the geometry's shape: the factor before the sum."""
    ratio = np.cos(geometry.theta_i) / np.cos(geometry.theta_r)
    D = geometric_factor(geometry)
    return math.pi * correlation_length**2 * ratio * np.square(D)


def _coherent(
    geometry: Geometry, sigma_h: float, X: FloatArray | float, Y: FloatArray | float
) -> FloatArray:
    """e^{-g} ρ₀², with ρ₀ = sinc(v_x X) sinc(v_y Y) (20) and sinc(x) = sin(x)/x."""
    v_x, v_y, _ = wave_vector(geometry)
    rho_0 = np.sinc(v_x * X / math.pi) * np.sinc(v_y * Y / math.pi)
    with np.errstate(under="ignore"):
        return np.exp(-optical_roughness(geometry, sigma_h)) * np.square(rho_0)


def _per_m(m: FloatArray, *_: FloatArray) -> FloatArray:
    return 1 / m


def _by_ln_g(m: FloatArray, g: FloatArray, _: FloatArray) -> FloatArray:
    return (m - g) / m


def _by_ln_t2(m: FloatArray, _: FloatArray, q: FloatArray) -> FloatArray:
    return (1 - q / m) / m


BECKMANN_SPIZZICHINO = Model(
    "beckmann_spizzichino",
    (SCALE, SIGMA_H, CORRELATION_LENGTH),
    lobe_brdf,
    lobe_gradient,
    lobe_validity,
)
