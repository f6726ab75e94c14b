"""Reference values of the reflectance: the printed formulas by other numerical methods.

Rough diffuse surface: (31) of 1995 over the printed facets (28), adaptively in the slope and by
double-exponential nodes in the azimuth; there the program's own integral is in closed form.
Wolff: H from Chandrasekhar's integral equation by iteration; the program computes H as a definite
integral. F from the textbook's amplitudes. Beckmann: the sum (77) of 1991 in 40 decimal digits.

Sources: M. Oren, S. K. Nayar, IJCV 14 (1995); S. Chandrasekhar, Radiative Transfer (Dover 1960),
chapter V, equation (35); L. B. Wolff, S. K. Nayar, M. Oren, IJCV 30 (1998), equations (2), (7),
(8); S. K. Nayar, K. Ikeuchi, T. Kanade, IEEE PAMI 13 (1991).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import Decimal, localcontext

import numpy as np

from analysis.models.rough.oren_nayar_exact import slope_kinks
from analysis.models.rough.v_cavity import Directions, critical_angle, unidirectional_single_slope
from instrument.geometry import FloatArray, Geometry

# Rough diffuse surface

_ACCURACY = 1e-8  # relative, of the adaptive quadrature over the slope
_AZIMUTHS = 80  # nodes between two kinks


def rough_surface(geometry: Geometry, albedo: float, sigmas_deg: Sequence[float]) -> FloatArray:
    """Return the BRDF in 1/sr of the Gaussian V-cavity surface, shape (sigmas, geometries).

    Takes about half a second per geometry, for all sigmas together.
    """
    angles = (geometry.theta_i.ravel(), geometry.theta_r.ravel(), geometry.dphi_deg.ravel())
    sigmas = np.radians(np.asarray(sigmas_deg, dtype=np.float64))
    columns = [
        _gaussian_mean(float(i), float(r), math.radians(dphi_deg), sigmas)
        for i, r, dphi_deg in zip(*angles, strict=True)
    ]
    direct, twice = np.stack(columns, axis=-1)
    return np.asarray(albedo / np.pi * (direct + albedo * twice))


def _gaussian_mean(theta_i: float, theta_r: float, dphi: float, sigmas: FloatArray) -> FloatArray:
    """(31): mean over the slopes of one-bounce and two-bounce light, (2, sigmas)."""
    from scipy.integrate import quad_vec

    larger, smaller = (np.array([f(theta_i, theta_r)]) for f in (max, min))

    def integrand(theta_a: float) -> FloatArray:
        density = np.exp(-0.5 * np.square(theta_a / sigmas)) * math.sin(theta_a)
        parts = _azimuthal_mean(theta_i, theta_r, dphi, theta_a)
        return np.stack([density, parts[0] * density, parts[1] * density])

    kinks = np.concatenate([slope_kinks(larger, smaller, np.array([dphi])).ravel(), sigmas])
    inside = np.unique(kinks[(kinks > 1e-6) & (kinks < np.pi / 2 - 1e-4)])
    low, high = 1e-9, np.pi / 2 - 1e-9
    total = quad_vec(
        integrand, low, high, points=inside, epsrel=_ACCURACY, epsabs=1e-11, norm="max", limit=400
    )[0]
    return np.asarray(total[1:] / total[0])


def _azimuthal_mean(theta_i: float, theta_r: float, dphi: float, theta_a: float) -> FloatArray:
    """(29): mean of the grooves (28) over half a circle of azimuths, cut at every kink; (2,)."""
    edges = _azimuth_kinks(theta_i, theta_r, dphi, theta_a)
    x, weight = _double_exponential(_AZIMUTHS)
    half = np.diff(edges) / 2
    phi_a = edges[:-1, None] + half[:, None] * (1 + x)
    towards = Directions(*(np.array(a) for a in (theta_i, 0.0, theta_r, dphi)))
    parts = unidirectional_single_slope(towards, np.array(theta_a), phi_a)
    return np.array([half @ (part @ weight) for part in parts]) / np.pi


def _azimuth_kinks(theta_i: float, theta_r: float, dphi: float, theta_a: float) -> FloatArray:
    """Azimuths where shadowing or masking sets in (39), or both are equally wide; ascending."""
    shadow, mask = (
        float(critical_angle(np.array(t), np.array(theta_a))) for t in (theta_i, theta_r)
    )
    i, r = math.tan(theta_i), math.tan(theta_r)
    alike = [math.atan2(s * i - r * math.cos(dphi), r * math.sin(dphi)) for s in (1, -1)]
    kinks = np.sort(np.mod([shadow, -shadow, dphi + mask, dphi - mask, *alike], np.pi))
    return np.append(kinks, kinks[0] + np.pi)


def _double_exponential(nodes: int) -> tuple[FloatArray, FloatArray]:
    """Nodes from -1 to 1 and weights, dense at the ends to resolve algebraic singularities there.

    H. Takahasi, M. Mori, Publications of RIMS, Kyoto University 9 (1974).
    """
    t, step = np.linspace(-3.1, 3.1, nodes, retstep=True)
    inner = np.pi / 2 * np.sinh(t)
    return np.tanh(inner), step * np.pi / 2 * np.cosh(t) / np.square(np.cosh(inner))


# Wolff's dielectric


def wolff(geometry: Geometry, rho: float, n: float) -> FloatArray:
    """Return the BRDF in 1/sr of (7) with (8), exact H and F; geometries and result are (N,)."""
    cos_i, cos_r = np.cos(geometry.theta_i), np.cos(geometry.theta_r)
    mu_i, mu_r = (np.sqrt(1 - (1 - np.square(c)) / n**2) for c in (cos_i, cos_r))
    x, weight, reflected = _inner_hemisphere(n)
    h_x, h_i, h_r = (_chandrasekhar_h(mu, rho) for mu in (x, mu_i, mu_r))
    K = rho / 2 * h_r * ((1 / (x + mu_r[:, None])) @ (weight * reflected * h_x))
    varrho_1 = rho / (4 * np.pi * n * n) * h_i * h_r / (mu_i + mu_r)
    through = (1 - _fresnel(cos_i, n)) * (1 - _fresnel(cos_r, n))
    return np.asarray(varrho_1 / (1 - K) * through)


def _inner_hemisphere(n: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return cosines inside, their weights times x, and the interface's reflectance there.

    Total reflection up to the critical cosine; above it, nodes in the cosine outside.
    """
    t, w = np.polynomial.legendre.leggauss(80)
    t, w = (t + 1) / 2, w / 2
    critical = math.sqrt(1 - 1 / n**2)
    below, below_weight = critical * t**3, critical * 3 * t * t * w
    outside = np.square(t)
    beyond = np.sqrt(1 - (1 - np.square(outside)) / n**2)
    beyond_weight = 2 * t * w * outside / (n * n)  # x dx = c dc / n^2
    return (
        np.concatenate([below, beyond]),
        np.concatenate([below_weight * below, beyond_weight]),
        np.concatenate([np.ones_like(below), _fresnel(outside, n)]),
    )


def _chandrasekhar_h(mu: FloatArray, rho: float) -> FloatArray:
    """H from 1/H(mu) = sqrt(1 - rho) + rho/2 int_0^1 x H(x)/(x + mu) dx, rho below 1."""
    t, w = np.polynomial.legendre.leggauss(160)
    x, weight = ((t + 1) / 2) ** 3, w / 2 * 3 * np.square((t + 1) / 2)
    kernel = rho / 2 * weight * x / (x + x[:, None])
    h = np.ones_like(x)
    for _ in range(400):
        new = 1 / (math.sqrt(1 - rho) + kernel @ h)
        settled = np.max(np.abs(new / h - 1)) < 1e-14
        h = (new + h) / 2  # undamped, the iteration oscillates about the solution
        if settled:
            break
    inner = (1 / (x + mu[:, None])) @ (weight * x * h)
    return np.asarray(1 / (math.sqrt(1 - rho) + rho / 2 * inner))


def _fresnel(cosine: FloatArray, n: float) -> FloatArray:
    """Reflectance of unpolarised light from outside: the mean of the two squared amplitudes."""
    inside = np.sqrt(1 - (1 - np.square(cosine)) / n**2)
    across = (cosine - n * inside) / (cosine + n * inside)
    along = (n * cosine - inside) / (n * cosine + inside)
    return np.asarray((across**2 + along**2) / 2)


# Beckmann and Spizzichino's lobe


def beckmann(geometry: Geometry, sigma_h: float, correlation_length: float) -> FloatArray:
    """Return the BRDF, (N,) in 1/sr, of (77) over (80), scale 1; lengths in wavelengths."""
    theta_i, theta_r = geometry.theta_i.ravel(), geometry.theta_r.ravel()
    phi = np.radians(geometry.dphi_deg.ravel())
    lengths = (sigma_h, correlation_length)
    return np.array([_lobe(*a, *lengths) for a in zip(theta_i, theta_r, phi, strict=True)])


def _lobe(theta_i: float, theta_r: float, dphi: float, sigma_h: float, T: float) -> float:
    cos_i, cos_r, sin_i, sin_r = (f(t) for f in (math.cos, math.sin) for t in (theta_i, theta_r))
    k, up = 2 * math.pi, cos_i + cos_r
    v_xy2 = k * k * (sin_i**2 + sin_r**2 + 2 * sin_i * sin_r * math.cos(dphi))
    D = (1 + cos_i * cos_r + sin_i * sin_r * math.cos(dphi)) / (cos_i * up)
    total = _long_sum((k * sigma_h * up) ** 2, max(v_xy2, 0.0) * T * T / 4)
    return cos_i / cos_r * math.pi * T * T * D * D * total


def _long_sum(g: float, q: float) -> float:
    """e^-g sum over m of g^m/(m! m) e^(-q/m), in 40 digits, until terms are negligible."""
    with localcontext() as digits:
        digits.prec = 40
        big_g, big_q = Decimal(g), Decimal(q)
        poisson, total, m = (-big_g).exp(), Decimal(0), 0
        while True:
            m += 1
            poisson *= big_g / m
            term = poisson * (-big_q / m).exp() / m
            total += term
            if m > g and term < total * Decimal("1e-20") and m * m * math.log(m / g) > q:
                return float(total)
