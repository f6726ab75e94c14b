"""Wolff's diffuse model for smooth dielectrics: subsurface scattering below a Fresnel interface.

What to use when: `wolff` for a smooth or slightly rough dielectric (below about 9 degrees);
`wolff_oren_nayar` from 9 to about 36 degrees; Oren and Nayar's models above.

Source: L. B. Wolff, S. K. Nayar, M. Oren, "Improved Diffuse Reflection Models for Computer
Vision", International Journal of Computer Vision 30 (1998), section 2.2.
"""

from __future__ import annotations

import numpy as np

from analysis.models.base import Model, Parameter, Validity
from analysis.models.smooth.fresnel import transmittance_with_gradients
from analysis.models.smooth.interface import both_transmittances, distinct_cosines, refracted
from analysis.models.smooth.internal_return import h_and_k, rays
from analysis.models.validity import GRAZING, both_graze, valid_except
from instrument.geometry import FloatArray, Geometry

SINGLE_SCATTERING_ALBEDO = Parameter(
    "single_scattering_albedo", "1", 0.0, 1.0, 0.9, starts=(0.3, 0.7, 0.95, 0.999), level=True
)
N = Parameter("n", "1", 1.0, 3.0, 1.5, starts=(1.15, 1.5, 2.0, 2.7), scanned=True)

_NO_INTERFACE = f"n = 1: {GRAZING}"


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
    cosine, index = distinct_cosines(geometry)
    mu = refracted(cosine, n)
    H, K = h_and_k(mu, single_scattering_albedo, n, order)
    varrho = _varrho(mu[index], H[index], K[index[1]], single_scattering_albedo, n)
    return np.asarray(varrho * both_transmittances(geometry, n, epsilon))


def wolff_gradient(
    geometry: Geometry, single_scattering_albedo: float, n: float
) -> dict[str, FloatArray]:
    """Derivatives of `wolff_brdf` by rho and n, under the integrals. As in `Model.gradient`.

    That by rho grows without limit as 1/sqrt(1 - rho): at rho = 1 that of 1 - 1e-12 is returned.
    """
    rho = single_scattering_albedo
    cosine, index = distinct_cosines(geometry)
    ray, (through, through_by_n, _) = refracted(cosine, n), transmittance_with_gradients(cosine, n)
    mu, T, dT = ray[index], through[index], through_by_n[index]
    inside = rays(ray, rho, n)
    by_rho, by_n = inside.log_h_by_rho[index], inside.log_h_by_n[index]
    K, K_by_rho, K_by_n = (one[index[1]] for one in (inside.K, inside.K_by_rho, inside.K_by_n))
    per_rho = _varrho(mu, inside.H[index], K, 1.0, n)
    growth = 1 + rho * (by_rho[0] + by_rho[1] + K_by_rho / (1 - K))
    # mu^2 = 1 - sin^2/n^2, so that d mu/dn = (1 - mu^2)/(n mu); the two summed:
    d_mu = np.sum(1 / mu - mu, axis=0) / n
    growth_by_n = by_n[0] + by_n[1] + K_by_n / (1 - K) - 2 / n - d_mu / (mu[0] + mu[1])
    transmitted = T[0] * T[1]
    return {
        "single_scattering_albedo": np.asarray(per_rho * transmitted * growth),
        "n": np.asarray(rho * per_rho * (growth_by_n * transmitted + T[1] * dT[0] + T[0] * dT[1])),
    }


def _varrho(mu: FloatArray, H: FloatArray, K: FloatArray, rho: float, n: float) -> FloatArray:
    """varrho of 1998 (8) in 1/sr: `mu` and `H` (2, ...) of lamp and camera, `K` of the camera."""
    varrho_1 = rho / (4 * np.pi * n * n) * H[0] * H[1] / (mu[0] + mu[1])
    return np.asarray(varrho_1 / (1 - K))


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
    H, K = h_and_k(refracted(np.cos(theta), n), single_scattering_albedo, n, order)
    return H, 1 - K


WOLFF = Model("wolff", (SINGLE_SCATTERING_ALBEDO, N), wolff_brdf, wolff_gradient, wolff_validity)
