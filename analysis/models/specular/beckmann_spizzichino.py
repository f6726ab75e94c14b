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
from collections.abc import Callable

import numpy as np

from analysis.models.base import Model, Parameter, Validity
from analysis.models.specular.surface_statistics import (
    check_lengths,
    curvature_radius,
    unshadowed_deg,
)
from analysis.models.specular.torrance_sparrow import tangential_squared
from analysis.models.validity import either_grazes, valid_except
from instrument.geometry import FloatArray, Geometry

SCALE = Parameter("scale", "1", 0.0, 10.0, 0.1, scale=True)
# Both lengths matter by their ratio to the wavelength: a fit tries decades.
SIGMA_H = Parameter(
    "sigma_h", "wavelengths", 0.0, 100.0, 0.5, starts=(0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 80.0)
)
CORRELATION_LENGTH = Parameter(
    "correlation_length", "wavelengths", 0.1, 1000.0, 10.0,
    starts=(0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 400.0),
)  # fmt: skip

K = 2 * math.pi  # the propagation constant (64), in 1/wavelength
Weight = Callable[..., FloatArray]  # of m, g and q


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
    g, q = optical_roughness(geometry, sigma_h), lobe_exponent(geometry, correlation_length)
    return scale * lobe_factor(geometry, correlation_length) * poisson_sum(g, q, _per_m)


def lobe_gradient(
    geometry: Geometry, scale: float, sigma_h: float, correlation_length: float
) -> dict[str, FloatArray]:
    """Derivatives of `lobe_brdf` by its parameters, sums over m again. As in `Model.gradient`."""
    g, q = optical_roughness(geometry, sigma_h), lobe_exponent(geometry, correlation_length)
    factor = lobe_factor(geometry, correlation_length)
    by_ln_g = poisson_sum(g, q, lambda m, g, _: (m - g) / m)
    by_ln_t2 = poisson_sum(g, q, lambda m, _, q: (1 - q / m) / m)
    per_sigma = scale * 2 / sigma_h if sigma_h > 1e-150 else 0.0  # f rises as sigma_h^2
    return {
        "scale": factor * poisson_sum(g, q, _per_m),
        "sigma_h": per_sigma * factor * by_ln_g,
        "correlation_length": scale * 2 / correlation_length * factor * by_ln_t2,
    }


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


# The sum over m.

BLOCK = 4096  # elements at a time: what a core's own cache holds
TERMWISE_BELOW = 40.0  # largest term from which on the sum is computed as an integral
STEP = 0.75  # of a standard deviation of the summand: the trapezoid's error is e^{-2π²/0.75²}
LEFT, RIGHT = 10, 13  # steps to either side: beyond them less than 1e-13 of a Poisson's sum
TINY = 1e-300


def _per_m(m: FloatArray, *_: FloatArray) -> FloatArray:
    return 1 / m


def poisson_sum(g: FloatArray, q: FloatArray, weight: Weight) -> FloatArray:
    """e^{-g} Σ_{m≥1} g^m/m! w(m) e^{-q/m}, element by element; w is smooth, as 1/m is in (18).

    `g` and `q`, dimensionless, broadcast to the result's shape. A largest term below m = 40: summed
    term by term (up to 110 of them, each from the one before it, without overflow). Beyond, the
    summand is a smooth bell of width s ≥ 1: by Poisson's summation formula its sum over integers
    and its sum in steps of h, times h, both are its integral but for e^{-2π²(s/h)²}. 24 nodes,
    0.75 s apart, then are enough at any g; where s is so narrow that h would be below 1, h = 1 is
    the sum itself. Largest relative error against sums of 25 digits: 2e-11 (g 18, q 1400: a skewed
    bell).
    """
    g, q = np.broadcast_arrays(g, q)
    flat_g, flat_q = g.ravel(), q.ravel()
    total = np.empty(flat_g.shape)
    with np.errstate(under="ignore"):
        for start in range(0, total.size, BLOCK):
            part = slice(start, start + BLOCK)
            total[part] = _block(flat_g[part], flat_q[part], weight)
    return total.reshape(g.shape)


def _block(g: FloatArray, q: FloatArray, weight: Weight) -> FloatArray:
    peak = largest_term(g, q)
    few = peak < TERMWISE_BELOW
    if few.all():
        return _term_by_term(g, q, float(peak.max(initial=0.0)), weight)
    if not few.any():
        return _in_wide_steps(g, q, peak, weight)
    total = np.empty(g.shape)
    total[few] = _term_by_term(g[few], q[few], float(peak[few].max()), weight)
    total[~few] = _in_wide_steps(g[~few], q[~few], peak[~few], weight)
    return total


def largest_term(g: FloatArray, q: FloatArray) -> FloatArray:
    """The m, not rounded, near which g^m/m! e^{-q/m} is largest: m² ln(m/g) = q, any shape.

    m = g e^{W/2} with W e^W = 2q/g² (Lambert's W): a start good to 2 % and two steps of
    R. Iacono, J. P. Boyd, Advances in Computational Mathematics 43 (2017), good to 1e-9.
    """
    g = np.maximum(g, 1e-100)
    y = np.maximum(2 * q / np.square(g), TINY)
    log = np.log1p(y)
    W = log * (1 - np.log1p(log) / (2 + log))
    for _ in range(2):
        W = W / (1 + W) * (1 + np.log(y / W))
    return np.asarray(g * np.exp(W / 2))


def _term_by_term(g: FloatArray, q: FloatArray, peak: float, weight: Weight) -> FloatArray:
    """The sum up to 9 standard deviations and 12 terms beyond the largest `peak`."""
    poisson = np.exp(-g)
    total = np.zeros(g.shape)
    for term in range(1, math.ceil(peak + 9 * math.sqrt(peak) + 12) + 1):
        m = np.float64(term)
        poisson = poisson * (g / m)
        total += poisson * np.exp(-q / m) * weight(m, g, q)
    return total


def _in_wide_steps(g: FloatArray, q: FloatArray, peak: FloatArray, weight: Weight) -> FloatArray:
    """The sum in steps of h around the largest term, times h."""
    g = np.maximum(g, TINY)
    h = np.maximum(1.0, STEP * np.sqrt(peak / (1 + 2 * q / np.square(peak))))
    middle = np.rint(peak)
    total = np.zeros(g.shape)
    for step in range(-LEFT, RIGHT + 1):
        m = np.maximum(middle + step * h, 0.5)  # terms so far down are negligible
        total += poisson_term(m, g) * np.exp(-q / m) * weight(m, g, q)
    return h * total


def poisson_term(m: FloatArray, g: FloatArray) -> FloatArray:
    """e^{-g} g^m/m! for real m above 10, to 1e-13 and the rounding of m - g; `m`, `g` broadcast.

    Dimensionless. By Stirling's series for m!, and g - m + m ln(m/g) = g ((1+d) ln(1+d) - d) with
    m = g (1+d): the exponents, which are as large as m ln g, never stand alone.
    """
    d = (m - g) / g
    r = 1 / m
    stirling = r * (1 / 12 - r * r * (1 / 360 - r * r / 1260))
    return np.exp(-g * ((1 + d) * np.log1p(d) - d) - stirling) / np.sqrt(2 * math.pi * m)


BECKMANN_SPIZZICHINO = Model(
    "beckmann_spizzichino",
    (SCALE, SIGMA_H, CORRELATION_LENGTH),
    lobe_brdf,
    lobe_gradient,
    lobe_validity,
)
