"""Chandrasekhar's H-function for isotropic scattering in a half-space.

What to use when: `h_exact` always; `h_order` to follow the paper. Order N needed for a relative
error, over albedos of 0 to 1, measured against `h_exact`:

    error             1e-2   1e-3   1e-4   1e-5   1e-6   1e-7
    mu of 0 to 1         7     63    621  ~6200      -      -
    mu of 0.1 to 1       6     22     72    227    718      -
    mu of 0.5 to 1       4     11     33    102    321   1015
    mu of 0.745 to 1     3      9     27     84    263    831    (all that `wolff` needs at n = 1.5)

The largest error is 0.062/N, near mu = 0.5/N, where H has a term mu ln(mu) that no finite product
has; away from there the error falls as 1/N^2.

Sources: S. Chandrasekhar, Radiative Transfer (Dover 1960), chapters III and V; L. B. Wolff,
S. K. Nayar, M. Oren, IJCV 30 (1998), section 2.2, with its indices corrected.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from analysis.models.tanh_rule import ONE_MINUS_X, W, X
from instrument.geometry import FloatArray

_T, _E = np.pi / 2 * X, np.pi / 2 * ONE_MINUS_X  # t, and pi/2 - t
_SIN2_E, _COS2_E = np.square(np.sin(_E)), np.square(np.cos(_E))
# 1 - t cot t = t^2/3 + t^4/45 + …: 2^(2j) |B_2j| / (2j)! for j = 1, 2, …
_SERIES = (1 / 3, 1 / 45, 2 / 945, 1 / 4725, 2 / 93555, 1382 / 638512875, 4 / 18243225)
_CHUNK = 64  # cosines at once: their table of products stays in cache


def h_exact(mu: ArrayLike, albedo: float) -> FloatArray:
    """H(mu) for cosines mu of 0 to 1 and a single-scattering albedo rho of 0 to 1.

    ln H(mu) = -(mu/pi) int_0^{pi/2} ln(1 - rho t cot t) / (cos^2 t + mu^2 sin^2 t) dt,
    with relative errors below 1e-12 (2e-14 measured), at rho = 1 too. `mu` has any shape, which is
    the result's; both are dimensionless.
    """
    mu, strength = _cosine(mu), _logarithms(albedo)
    flat = mu.ravel()
    integral = np.empty_like(flat)
    for start in range(0, flat.size, _CHUNK):
        part = slice(start, start + _CHUNK)
        integral[part] = _table(flat[part]) @ strength
    return np.asarray(np.exp(flat / -np.pi * integral).reshape(mu.shape))


@dataclass(frozen=True, slots=True)
class HFunction:
    """ln H and its derivatives at the same cosines for several albedos, of one table of products.

    mu: cosines (N,), dimensionless. table: (N, T), 1 / (cos^2 t + mu^2 sin^2 t) at the nodes t.
    """

    mu: FloatArray
    table: FloatArray

    @classmethod
    def at(cls, mu: ArrayLike) -> HFunction:
        """H at the cosines mu (N,) of 0 to 1."""
        mu = _cosine(mu)
        return cls(mu, _table(mu))

    def log(self, albedo: float) -> FloatArray:
        """ln H, (N,), dimensionless, under the integral of `h_exact`."""
        return np.asarray(self.mu / -np.pi * (self.table @ _logarithms(albedo)))

    def log_gradient(self, albedo: float) -> FloatArray:
        """Derivative of ln H by the albedo rho < 1, (N,), dimensionless.

        Under the integral of `h_exact`:
        (mu/pi) int_0^{pi/2} t cot t / (1 - rho t cot t) / (cos^2 t + mu^2 sin^2 t) dt; it grows as
        1/sqrt(1 - rho).
        """
        if not 0 <= albedo < 1:
            raise ValueError(f"albedo = {albedo:g}; allowed: 0 to 1, below 1")
        t_cot_t = 1 - _ONE_MINUS_T_COT_T
        rest = (1 - albedo) + albedo * _ONE_MINUS_T_COT_T
        return np.asarray(self.mu / np.pi * (self.table @ (np.pi / 2 * W * t_cot_t / rest)))

    def log_gradient_by_mu(self, albedo: float) -> FloatArray:
        """Derivative of ln H by mu above 0, (N,), dimensionless, under the integral of `h_exact`.

        -(1/pi) int_0^{pi/2} ln(1 - rho t cot t) (cos^2 t - mu^2 sin^2 t)
        / (cos^2 t + mu^2 sin^2 t)^2 dt.
        """
        mu2 = np.square(self.mu)[:, np.newaxis]
        kernel = (_SIN2_E - mu2 * _COS2_E) * np.square(self.table)
        return np.asarray(kernel @ _logarithms(albedo) / -np.pi)


def _table(mu: FloatArray) -> FloatArray:
    """1 / (cos^2 t + mu^2 sin^2 t) for mu (N,) at the nodes t, (N, T)."""
    m = mu[:, np.newaxis]
    return np.asarray(1 / (_SIN2_E + m * m * _COS2_E))


def h_order(mu: ArrayLike, albedo: float, order: int) -> FloatArray:
    """H(mu) in the N-th order form, N = `order`: H = prod (1 + mu/mu_i) / prod (1 + kappa_a mu).

    i and a run from 1 to N (errata: 1998 mixes n and N); mu_i are the positive zeros of P_2N.
    `mu` of any shape, a cosine, dimensionless.
    """
    mu = _cosine(mu)[..., np.newaxis]
    mu_i, _ = _gauss(order)
    kappa = characteristic_roots(albedo, order)
    # The largest 1/mu_i over the largest kappa: each factor is near 1, and none overflows.
    result: FloatArray = np.prod((1 + mu / mu_i[::-1]) / (1 + kappa * mu), axis=-1)
    return result


@lru_cache(maxsize=256)
def characteristic_roots(albedo: float, order: int) -> FloatArray:
    """Roots kappa >= 0, (N,), rising, of 1 = rho sum_j a_j / (1 - kappa^2 mu_j^2).

    They are dimensionless. Their squares are the eigenvalues of diag(1/mu_j^2) - rho z z^T with
    z_j = sqrt(a_j)/mu_j. The smallest comes from prod kappa^2 = (1 - rho) prod 1/mu_j^2: exactly 0
    at rho = 1.
    """
    _in_unit("albedo", albedo)
    mu_j, a_j = _gauss(order)
    z = np.sqrt(a_j) / mu_j
    squares = np.linalg.eigvalsh(np.diag(mu_j**-2) - albedo * np.outer(z, z))
    # Each factor of the product is near 1, as the roots lie between the poles.
    squares[0] = (1 - albedo) * mu_j[-1] ** -2 * np.prod(mu_j[-2::-1] ** -2 / squares[1:])
    kappa: FloatArray = np.sqrt(squares)
    kappa.setflags(write=False)  # shared by all callers
    return kappa


@lru_cache(maxsize=64)
def _gauss(order: int) -> tuple[FloatArray, FloatArray]:
    """Positive zeros mu_j of P_2N, rising, and their Gauss weights a_j, which sum to 1."""
    if order < 1:
        raise ValueError(f"order = {order}; allowed: 1 or more")
    zeros, weights = np.polynomial.legendre.leggauss(2 * order)
    return zeros[order:], weights[order:]


@lru_cache(maxsize=256)
def _logarithms(albedo: float) -> FloatArray:
    """Weights times ln(1 - rho t cot t) at the nodes."""
    rest = (1 - _in_unit("albedo", albedo)) + albedo * _ONE_MINUS_T_COT_T
    result: FloatArray = np.pi / 2 * W * np.log(rest)
    return result


def _one_minus_t_cot_t() -> FloatArray:
    series = np.polynomial.polynomial.polyval(_T * _T, (0.0, *_SERIES))
    return np.asarray(np.where(_T < 0.1, series, 1 - _T * np.tan(_E)))


def _cosine(mu: ArrayLike) -> FloatArray:
    mu = np.asarray(mu, dtype=np.float64)
    fine = (mu >= 0) & (mu <= 1)
    if not np.all(fine):
        raise ValueError(f"mu = {mu[~fine].flat[0]:.12g}; allowed: 0 to 1")
    return mu


def _in_unit(name: str, value: float) -> float:
    if not 0 <= value <= 1 or math.isnan(value):
        raise ValueError(f"{name} = {value:g}; allowed: 0 to 1")
    return value


_ONE_MINUS_T_COT_T = _one_minus_t_cot_t()
