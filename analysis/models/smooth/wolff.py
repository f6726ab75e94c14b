"""Wolff's diffuse model for smooth dielectrics: subsurface scattering below a Fresnel interface.

What to use when: `wolff` for a smooth or slightly rough dielectric (below about 9 degrees);
`wolff_oren_nayar` from 9 to about 36 degrees; Oren and Nayar's models above.

Source: L. B. Wolff, S. K. Nayar, M. Oren, "Improved Diffuse Reflection Models for Computer
Vision", International Journal of Computer Vision 30 (1998), section 2.2.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from analysis.models.base import Model, Parameter, Validity
from analysis.models.smooth.chandrasekhar import (
    h_exact,
    h_order,
    log_h_gradient,
    log_h_gradient_by_mu,
)
from analysis.models.smooth.fresnel import (
    transmittance,
    transmittance_gradient,
    transmittance_gradient_by_cosine,
    wolff_polynomial,
)
from analysis.models.tanh_rule import W, X
from analysis.models.validity import GRAZING, both_graze, valid_except
from instrument.geometry import FloatArray, Geometry, IntArray

SINGLE_SCATTERING_ALBEDO = Parameter(
    "single_scattering_albedo", "1", 0.0, 1.0, 0.9, starts=(0.3, 0.7, 0.95, 0.999), level=True
)
N = Parameter("n", "1", 1.0, 3.0, 1.5, starts=(1.15, 1.5, 2.0, 2.7), scanned=True)

# K's integrand has poles as near to 0 as the critical cosine: from this n on 40 nodes, clustered at
# 0 where H has a term x ln(x), are enough for 1e-11; below it the tanh rule is used, which
# tolerates poles.
_BEND_INSIDE = 1.00001
# Up to so many distinct cosines, direct evaluation is cheaper than making a series; larger arrays
# than the second number are not searched for distinct cosines.
_FEW_COSINES, _MOST_SEARCHED = 64, 2048

_NO_INTERFACE = f"n = 1: {GRAZING}"


def _clustered() -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre nodes and weights from 0 to 1, clustered at 0 by a cube."""
    t, w = np.polynomial.legendre.leggauss(40)
    t = (t + 1) / 2
    return t**3, w / 2 * 3 * t * t


_NODES = _clustered()


def wolff_brdf(
    geometry: Geometry,
    single_scattering_albedo: float,
    n: float,
    epsilon: float | None = None,
    order: int | None = None,
) -> FloatArray:
    """Wolff's BRDF: 1998, equations (7) and (8), over L_i cos(theta_i) d omega.

    varrho (1 - F(theta_i, n)) (1 - F(asin(sin(theta_r)/n), 1/n)) with varrho = varrho_1/(1 - K).
    rho is the fraction of the light that a scatterer inside does not absorb, n the index of the
    material. F and H exact; relative error below 1e-10. Never negative; the same at every
    azimuth. At n = 1 it is Chandrasekhar's law for a bare half-space. With an `epsilon` both F of
    (7), of theta_i and theta_r, are Wolff's polynomial (0.07 for most dielectrics; at n = 1.5
    that is 5 % darker at normal incidence, 12 % at 50/50 and 35 % at 70/70 degrees); varrho keeps
    the exact one. With an `order` every H, in K too, is Chandrasekhar's of that order.
    Other arguments and the result as in `Model.brdf`.

    Not quite reciprocal, as K depends on theta_r alone (errata). Largest difference on exchange of
    lamp and camera, over all angles, at normal against grazing: for n = 1.5 it is 1.5 % at
    rho = 0.5, 4.3 % at 0.9, 5.1 % at 0.98 and 2.4 % at 1; over all rho 5.6 % at n = 1.2 and 1.3,
    3.7 % at n = 2, and none at n = 1. For the same reason diffuse and mirror reflection together
    exceed 1 at rho = 1, by up to 1.3 % (n = 1.2, normal incidence; 1.0 % for n = 1.5).
    """
    rho = single_scattering_albedo
    mu = _both_refracted(geometry, n)
    H, K = _h_and_k(mu, rho, n, order)
    varrho_1 = rho / (4 * np.pi * n * n) * H[0] * H[1] / (mu[0] + mu[1])
    return np.asarray(varrho_1 / (1 - K[1]) * both_transmittances(geometry, n, epsilon))


def wolff_gradient(
    geometry: Geometry, single_scattering_albedo: float, n: float
) -> dict[str, FloatArray]:
    """Derivatives of `wolff_brdf` by rho and n, under the integrals. As in `Model.gradient`.

    That by rho grows without limit as 1/sqrt(1 - rho): at rho = 1 that of 1 - 1e-12 is returned.
    """
    rho = single_scattering_albedo
    mu = _both_refracted(geometry, n)
    H, K = _h_and_k(mu, rho, n)
    dlog_H, dK = _h_and_k_gradient(mu, min(rho, 1 - 1e-12), n)
    per_rho = H[0] * H[1] / (4 * np.pi * n * n * (mu[0] + mu[1]) * (1 - K[1]))
    growth = 1 + rho * (dlog_H[0] + dlog_H[1] + dK[1] / (1 - K[1]))
    transmitted = both_transmittances(geometry, n)
    growth_by_n = _growth_by_n(mu, K[1], rho, n)
    by_n = rho * per_rho * (growth_by_n * transmitted + both_transmittances_gradient(geometry, n))
    return {
        "single_scattering_albedo": np.asarray(per_rho * transmitted * growth),
        "n": np.asarray(by_n),
    }


def _growth_by_n(mu: FloatArray, K: FloatArray, rho: float, n: float) -> FloatArray:
    """Derivative of ln varrho by n, along the two rays `mu` (2, ...) inside."""
    dlog_H, dK = _h_and_k_by_n(mu, rho, n)
    # mu^2 = 1 - sin^2/n^2, so that d mu/dn = (1 - mu^2)/(n mu); the two summed:
    d_mu = np.sum(1 / mu - mu, axis=0) / n
    return np.asarray(dlog_H[0] + dlog_H[1] + dK[1] / (1 - K) - 2 / n - d_mu / (mu[0] + mu[1]))


def wolff_validity(geometry: Geometry, single_scattering_albedo: float, n: float) -> Validity:
    """Valid unless n = 1 (a bare half-space) and both directions graze. As in `Model.brdf`."""
    scatters = single_scattering_albedo > 0
    return valid_except(geometry, (both_graze(geometry) & scatters & (n == 1), _NO_INTERFACE))


def ray_terms(
    theta: FloatArray, single_scattering_albedo: float, n: float, order: int | None = None
) -> tuple[FloatArray, FloatArray]:
    """H and 1 - K, the factors of varrho, along rays at `theta` outside ((N,), radians).

    With an `order` H is Chandrasekhar's of that order, in K too.
    """
    mu, rho = _refracted(theta, n), single_scattering_albedo
    return _h(mu, rho, order), 1 - internal_return(mu, rho, n, order)


def internal_return(
    mu_ref: FloatArray, single_scattering_albedo: float, n: float, order: int | None = None
) -> FloatArray:
    """K of 1998 (8): light reflected back inside by the interface and scattered again.

    K = int_0^{pi/2} F(phi', 1/n) C_rho(cos phi', mu_ref) 2 pi sin(phi') dphi', with (errata)
    C_rho(x, y) = rho/(4 pi) x/(x + y) H(x) H(y), and F = 1 beyond the critical angle. `mu_ref`,
    (N,), is the cosine inside. The result, (N,), is below 1, and 0 for n = 1.
    """
    rho = single_scattering_albedo
    x, weight = _inside(rho, n, order)
    return rho / 2 * _h(mu_ref, rho, order) * ((1 / (x + mu_ref[:, np.newaxis])) @ weight)


def _h(mu: FloatArray, rho: float, order: int | None) -> FloatArray:
    return h_exact(mu, rho) if order is None else h_order(mu, rho, order)


def _internal_return_gradient(mu_ref: FloatArray, rho: float, n: float) -> FloatArray:
    """Derivative of `internal_return` by rho, under the integral."""
    x, weight = _inside(rho, n)
    H, dlog_H = h_exact(mu_ref, rho), log_h_gradient(mu_ref, rho)
    inverse = 1 / (x + mu_ref[:, np.newaxis])
    by_x = rho * (inverse @ (weight * log_h_gradient(x, rho)))
    return np.asarray(H / 2 * ((1 + rho * dlog_H) * (inverse @ weight) + by_x))


def _h_and_k(
    mu: FloatArray, rho: float, n: float, order: int | None = None
) -> tuple[FloatArray, FloatArray]:
    """H(mu) and K(mu): of few cosines, as a scan has, computed directly; of many, by series."""
    few = _few_cosines(mu)
    if few is not None:
        cosines, place = few
        return _h(cosines, rho, order)[place], internal_return(cosines, rho, n, order)[place]
    log_H, K = _evaluate(_h_and_k_series(rho, n, order), mu, n)
    return np.asarray(np.exp(log_H), dtype=np.float64), K


def _h_and_k_gradient(mu: FloatArray, rho: float, n: float) -> tuple[FloatArray, FloatArray]:
    """Derivatives of ln H(mu) and K(mu) by rho < 1."""
    few = _few_cosines(mu)
    if few is not None:
        cosines, place = few
        return log_h_gradient(cosines, rho)[place], _internal_return_gradient(cosines, rho, n)[
            place
        ]
    dlog_H, dK = _evaluate(_h_and_k_gradient_series(rho, n), mu, n)
    return dlog_H, dK


def _few_cosines(mu: FloatArray) -> tuple[FloatArray, IntArray] | None:
    """Distinct cosines and the index of each `mu` among them; None where they are many."""
    if mu.size > _MOST_SEARCHED:
        return None
    cosines, place = np.unique(mu, return_inverse=True)
    return (cosines, place.reshape(mu.shape)) if cosines.size <= _FEW_COSINES else None


def _internal_return_by_n(mu_ref: FloatArray, rho: float, n: float) -> FloatArray:
    """Derivative of `internal_return` by n at the same cosine inside, as an integral.

    x dx = c dc/n^2 with c = sqrt(1 - n^2 (1 - x^2)) the cosine outside, -dc/dn = (1 - c^2)/(n c);
    the end at the critical angle adds nothing, as F = 1 on both sides of it.
    """
    c, weight = _NODES if n >= _BEND_INSIDE else (X, W)
    sin2 = (1 - c) * (1 + c)
    outside = np.arccos(c)
    dF = c * transmittance_gradient(outside, n)
    dF = sin2 / n * transmittance_gradient_by_cosine(outside, n) - dF
    x = _refracted(outside, n)
    weight = weight * dF * h_exact(x, rho) / (n * n)
    return np.asarray(rho / 2 * h_exact(mu_ref, rho) * ((1 / (x + mu_ref[:, np.newaxis])) @ weight))


@lru_cache(maxsize=64)
def _h_and_k_series(rho: float, n: float, order: int | None = None) -> FloatArray:
    mu, to_series = _chebyshev(n)
    values = [np.log(_h(mu, rho, order)), internal_return(mu, rho, n, order)]
    return np.asarray(to_series @ np.stack(values, axis=1))


@lru_cache(maxsize=64)
def _h_and_k_gradient_series(rho: float, n: float) -> FloatArray:
    mu, to_series = _chebyshev(n)
    gradients = [log_h_gradient(mu, rho), _internal_return_gradient(mu, rho, n)]
    return np.asarray(to_series @ np.stack(gradients, axis=1))


def _h_and_k_by_n(mu: FloatArray, rho: float, n: float) -> tuple[FloatArray, FloatArray]:
    """Derivatives of ln H(mu) and K(mu) by n along a ray, whose mu changes with n."""
    few = _few_cosines(mu)
    if few is not None:
        dlog_H, dK = _direct_by_n(few[0], rho, n)
        return dlog_H[few[1]], dK[few[1]]
    log_H, K, by_n = _evaluate(_h_and_k_by_n_series(rho, n), mu, n)
    d_log_mu = (1 / (mu * mu) - 1) / n
    return log_H * d_log_mu, K * d_log_mu + by_n


def _direct_by_n(mu: FloatArray, rho: float, n: float) -> tuple[FloatArray, FloatArray]:
    """`_h_and_k_by_n` of a few cosines (N,), without a series."""
    H, dlog_H = h_exact(mu, rho), log_h_gradient_by_mu(mu, rho)
    x, weight = _inside(rho, n)
    inverse = 1 / (x + mu[:, np.newaxis])
    K_by_mu = rho / 2 * H * (dlog_H * (inverse @ weight) - np.square(inverse) @ weight)
    d_mu = (1 / mu - mu) / n
    by_n = _internal_return_by_n(mu, rho, max(n, 1 + 1e-12))
    return dlog_H * d_mu, K_by_mu * d_mu + by_n


@lru_cache(maxsize=64)
def _h_and_k_by_n_series(rho: float, n: float) -> FloatArray:
    """Derivatives of ln H and of K by ln(mu), and of K by n at the same mu."""
    mu, to_series = _chebyshev(n)
    by_log_mu = np.polynomial.chebyshev.chebder(_h_and_k_series(rho, n)) * (-2 / _log_lowest(n))
    by_n = to_series @ _internal_return_by_n(mu, rho, max(n, 1 + 1e-12))
    return np.concatenate([np.pad(by_log_mu, ((0, 1), (0, 0))), by_n[:, np.newaxis]], axis=1)


@lru_cache(maxsize=64)
def _chebyshev(n: float) -> tuple[FloatArray, FloatArray]:
    """Cosines from grazing to 1, and the matrix from values there to a Chebyshev series in ln(mu).

    H and K are analytic but for mu <= 0, which lies pi off the line of ln(mu): the number of
    terms for 1e-14 grows as the line's length, from 26 at n = 1.5 to 285 at n = 1 (2e-12 there).
    """
    lowest = _log_lowest(n)
    degree = 22 + math.ceil(-7 * lowest)
    z = np.polynomial.chebyshev.chebpts1(degree + 1)
    to_series = np.asarray(np.polynomial.chebyshev.chebvander(z, degree).T, dtype=np.float64)
    to_series *= 2 / (degree + 1)
    to_series[0] /= 2
    return np.asarray(np.exp(lowest / 2 * (1 - z))), to_series


def _evaluate(series: FloatArray, mu: FloatArray, n: float) -> FloatArray:
    """The two functions of the series, first axis, at the cosines inside."""
    z = 1 - 2 * np.log(np.minimum(mu, 1.0)) / _log_lowest(n)
    return np.asarray(np.polynomial.chebyshev.chebval(z, series))


def _log_lowest(n: float) -> float:
    """ln(mu) inside at grazing."""
    return math.log(float(_refracted(np.array(np.pi / 2), n)))


@lru_cache(maxsize=64)
def _inside(rho: float, n: float, order: int | None = None) -> tuple[FloatArray, FloatArray]:
    """Nodes x = cos phi' and weights F x H(x) dx of K's integral.

    Below the critical cosine F = 1. Above, by Snell's law, x dx = c dc / n^2 with c the cosine
    outside: there F(phi', 1/n) = F(c, n) is smooth, which in x it is not.
    """
    critical = math.sqrt((n - 1) * (n + 1)) / n
    t, dt = _NODES if n >= _BEND_INSIDE else (X, W)
    outside = np.arccos(t)
    x = np.concatenate([critical * t, _refracted(outside, n)])
    F_x_dx = np.concatenate(
        [critical * dt * critical * t, (1 - transmittance(outside, n)) * dt * t / (n * n)]
    )
    return x, F_x_dx * _h(x, rho, order)


def _refracted(theta: FloatArray, n: float) -> FloatArray:
    """Cosine inside: sqrt(1 - sin^2(theta)/n^2), accurate at grazing for n near 1."""
    squared = (n - 1) * (n + 1) + np.square(np.cos(theta))
    return np.asarray(np.minimum(np.sqrt(squared) / n, 1.0))  # rounding may leave it above 1


def _both_refracted(geometry: Geometry, n: float) -> FloatArray:
    """Cosines inside of the lamp's and of the camera's ray, shape (2, ...)."""
    return np.stack([_refracted(geometry.theta_i, n), _refracted(geometry.theta_r, n)])


def both_transmittances(geometry: Geometry, n: float, epsilon: float | None = None) -> FloatArray:
    """(1 - F(theta_i, n)) (1 - F(asin(sin(theta_r)/n), 1/n)): the way in and the way out.

    Dimensionless, of the geometry's shape. The way out transmits like the way in from theta_r. With
    an `epsilon` by Wolff's polynomial.
    """
    if epsilon is None:
        return transmittance(geometry.theta_i, n) * transmittance(geometry.theta_r, n)
    F_i, F_r = (wolff_polynomial(t, epsilon) for t in (geometry.theta_i, geometry.theta_r))
    return (1 - F_i) * (1 - F_r)


def both_transmittances_gradient(geometry: Geometry, n: float) -> FloatArray:
    """Derivative of the exact `both_transmittances` by n. As in `Model.gradient`."""
    T_i, T_r = transmittance(geometry.theta_i, n), transmittance(geometry.theta_r, n)
    dT_i, dT_r = (transmittance_gradient(t, n) for t in (geometry.theta_i, geometry.theta_r))
    return T_r * dT_i + T_i * dT_r


WOLFF = Model("wolff", (SINGLE_SCATTERING_ALBEDO, N), wolff_brdf, wolff_gradient, wolff_validity)
