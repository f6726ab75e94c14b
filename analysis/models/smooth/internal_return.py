"""Multiple scattering below the interface: H and K along rays inside, and their derivatives.

K is the light that the interface reflects back inside. Of few rays, as a scan has, all is computed
directly; of many, by a series in ln(mu), which is then cheaper.

Source: L. B. Wolff, S. K. Nayar, M. Oren, "Improved Diffuse Reflection Models for Computer
Vision", International Journal of Computer Vision 30 (1998), section 2.2.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from analysis.models.smooth.chandrasekhar import HFunction, h_exact, h_order
from analysis.models.smooth.fresnel import transmittance_at_cosine, transmittance_with_gradients
from analysis.models.smooth.interface import log_lowest, refracted
from analysis.models.tanh_rule import W, X
from instrument.geometry import FloatArray

# K's integrand has poles as near to 0 as the critical cosine: from this n on 40 nodes, clustered at
# 0 where H has a term x ln(x), are enough for 1e-11; below it the tanh rule is used, which
# tolerates poles.
_BEND_INSIDE = 1.00001
# Up to so many cosines, direct evaluation is cheaper than making a series.
_FEW_COSINES = 64
# Cosines at once: their Chebyshev polynomials stay in cache.
_CHUNK = 2048
# Distance from 1 of rho and of n, at which a derivative grows without limit.
_OFF_ONE = 1e-12


def _clustered() -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre nodes and weights from 0 to 1, clustered at 0 by a cube."""
    t, w = np.polynomial.legendre.leggauss(40)
    t = (t + 1) / 2
    return t**3, w / 2 * 3 * t * t


_CLUSTERED = _clustered()


class Rays(NamedTuple):
    """H and K along M rays, (M,) each, and the derivatives of ln H and K by rho and by n.

    Along a ray n changes mu too.
    """

    H: FloatArray
    K: FloatArray
    log_h_by_rho: FloatArray
    K_by_rho: FloatArray
    log_h_by_n: FloatArray
    K_by_n: FloatArray


def internal_return(
    mu_ref: FloatArray, single_scattering_albedo: float, n: float, order: int | None = None
) -> FloatArray:
    """K of 1998 (8): light reflected back inside by the interface and scattered again.

    K = int_0^{pi/2} F(phi', 1/n) C_rho(cos phi', mu_ref) 2 pi sin(phi') dphi', with (errata)
    C_rho(x, y) = rho/(4 pi) x/(x + y) H(x) H(y), and F = 1 beyond the critical angle. `mu_ref`,
    (N,), is the cosine inside. The result, (N,), is below 1, and 0 for n = 1.
    """
    return _directly(mu_ref, single_scattering_albedo, n, order)[1]


def h_and_k(
    mu: FloatArray, rho: float, n: float, order: int | None = None
) -> tuple[FloatArray, FloatArray]:
    """H(mu) and K(mu), (N,) each, at cosines mu (N,) inside; dimensionless.

    With an `order` H is Chandrasekhar's of that order, in K too.
    """
    if mu.size <= _FEW_COSINES:
        return _directly(mu, rho, n, order)
    log_H, K = _evaluate(_series(rho, n, order), mu, n)
    return np.asarray(np.exp(log_H), dtype=np.float64), K


def rays(mu: FloatArray, rho: float, n: float) -> Rays:
    """H, K and derivatives at cosines mu (N,) inside, dimensionless; by rho at 1: of 1 - 1e-12."""
    if mu.size <= _FEW_COSINES:
        return _rays_directly(mu, rho, n)
    both = np.concatenate([_series(rho, n), _gradient_series(rho, n)], axis=1)
    log_H, K, by_rho, K_by_rho, by_log_mu, K_by_log_mu, K_by_n = _evaluate(both, mu, n)
    d_log_mu = (1 / (mu * mu) - 1) / n
    by_n, K_along = by_log_mu * d_log_mu, K_by_log_mu * d_log_mu + K_by_n
    return Rays(np.exp(log_H), K, by_rho, K_by_rho, by_n, K_along)


def _h(mu: FloatArray, rho: float, order: int | None) -> FloatArray:
    return h_exact(mu, rho) if order is None else h_order(mu, rho, order)


def _directly(
    mu: FloatArray, rho: float, n: float, order: int | None
) -> tuple[FloatArray, FloatArray]:
    H, inside = _h(mu, rho, order), _inside(n)
    inverse = 1 / (inside.x + mu[:, np.newaxis])
    return H, rho / 2 * H * (inverse @ (inside.F_x_dx * _h_inside(rho, n, order)))


def _rays_directly(mu: FloatArray, rho: float, n: float) -> Rays:
    """H, K and derivatives under the integrals, with d mu/dn = (1/mu - mu)/n along a ray."""
    here, inside, below_1 = HFunction.at(mu), _inside(n), min(rho, 1 - _OFF_ONE)
    H, by_rho = np.exp(here.log(rho)), here.log_gradient(below_1)
    by_mu, H_x = here.log_gradient_by_mu(rho), _h_inside(rho, n, None)
    weight = inside.F_x_dx * H_x
    weights = weight, weight * inside.H.log_gradient(below_1), inside.F_by_n_dx * H_x
    inverse = 1 / (inside.x + mu[:, np.newaxis])
    half = rho / 2 * H
    returned, by_x, by_F = half * (inverse @ np.stack(weights, axis=1)).T
    K_by_mu = by_mu * returned - half * (np.square(inverse) @ weight)
    d_mu = (1 / mu - mu) / n
    K_by_rho = H / 2 * (inverse @ weight) + by_rho * returned + by_x
    return Rays(H, returned, by_rho, K_by_rho, by_mu * d_mu, K_by_mu * d_mu + by_F)


class _Inside(NamedTuple):
    """Nodes x = cos phi' of K's integral (P,): H there, weights F x dx, and their change with n."""

    x: FloatArray
    H: HFunction
    F_x_dx: FloatArray
    F_by_n_dx: FloatArray


@lru_cache(maxsize=16)
def _inside(n: float) -> _Inside:
    """Nodes below and above the critical cosine, for one index.

    Below, F = 1. Above, by Snell's law, x dx = c dc / n^2 with c the cosine outside: there
    F(phi', 1/n) = F(c, n) is smooth, which in x it is not. With
    c = sqrt(1 - n^2 (1 - x^2)), -dc/dn = (1 - c^2)/(n c) at the same x; the end at the critical
    angle adds nothing to the derivative, as F = 1 on both sides of it.
    """
    critical = math.sqrt((n - 1) * (n + 1)) / n
    c, dc = _CLUSTERED if n >= _BEND_INSIDE else (X, W)
    x, above_1 = np.concatenate([critical * c, refracted(c, n)]), max(n, 1 + _OFF_ONE)
    _, by_n, by_c = transmittance_with_gradients(c, above_1)
    F = 1 - transmittance_at_cosine(c, n)
    F_x_dx = np.concatenate([critical * dc * critical * c, F * dc * c / (n * n)])
    dF = (1 - c) * (1 + c) / above_1 * by_c - c * by_n
    F_by_n_dx = np.concatenate([np.zeros_like(c), dF * dc / (above_1 * above_1)])
    return _Inside(x, HFunction.at(x), F_x_dx, F_by_n_dx)


@lru_cache(maxsize=64)
def _h_inside(rho: float, n: float, order: int | None) -> FloatArray:
    """H at the nodes of K's integral."""
    inside = _inside(n)
    return np.exp(inside.H.log(rho)) if order is None else h_order(inside.x, rho, order)


@lru_cache(maxsize=64)
def _series(rho: float, n: float, order: int | None = None) -> FloatArray:
    """Series of ln H and K."""
    mu, to_series = _chebyshev(n)
    H, K = _directly(mu, rho, n, order)
    return np.asarray(to_series @ np.stack([np.log(H), K], axis=1))


@lru_cache(maxsize=64)
def _gradient_series(rho: float, n: float) -> FloatArray:
    """Series of the derivatives of ln H and K by rho and ln(mu), and of K by n at fixed mu."""
    mu, to_series = _chebyshev(n)
    by_log_mu = np.polynomial.chebyshev.chebder(_series(rho, n)) * (-2 / log_lowest(n))
    direct, inside = _rays_directly(mu, rho, n), _inside(n)
    by_n = (1 / (inside.x + mu[:, np.newaxis])) @ (inside.F_by_n_dx * _h_inside(rho, n, None))
    by_n *= rho / 2 * direct.H
    others = to_series @ np.stack([direct.log_h_by_rho, direct.K_by_rho, by_n], axis=1)
    return np.column_stack([others[:, :2], np.pad(by_log_mu, ((0, 1), (0, 0))), others[:, 2]])


@lru_cache(maxsize=64)
def _chebyshev(n: float) -> tuple[FloatArray, FloatArray]:
    """Cosines from grazing to 1, and the matrix from values there to a Chebyshev series in ln(mu).

    H and K are analytic but for mu <= 0, which lies pi off the line of ln(mu): the number of
    terms for 1e-14 grows as the line's length, from 26 at n = 1.5 to 285 at n = 1 (2e-12 there).
    """
    lowest = log_lowest(n)
    degree = 22 + math.ceil(-7 * lowest)
    z = np.polynomial.chebyshev.chebpts1(degree + 1)
    to_series = np.asarray(np.polynomial.chebyshev.chebvander(z, degree).T, dtype=np.float64)
    to_series *= 2 / (degree + 1)
    to_series[0] /= 2
    return np.asarray(np.exp(lowest / 2 * (1 - z))), to_series


def _evaluate(series: FloatArray, mu: FloatArray, n: float) -> FloatArray:
    """The functions of the series, first axis, at the cosines inside."""
    z = 1 - 2 * np.log(np.minimum(mu, 1.0)) / log_lowest(n)
    values = np.empty((series.shape[1], mu.size))
    for start in range(0, mu.size, _CHUNK):
        part = slice(start, start + _CHUNK)
        terms = np.polynomial.chebyshev.chebvander(z[part], len(series) - 1)
        values[:, part] = (terms @ series).T
    return values
