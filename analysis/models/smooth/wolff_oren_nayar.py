"""Wolff's combination of the smooth dielectric with Oren and Nayar's rough surface.

What to use when: slightly rough dielectrics, from 9 to about 36 degrees of slope; `wolff` below,
Oren and Nayar's models above.

Source: L. B. Wolff, S. K. Nayar, M. Oren, "Improved Diffuse Reflection Models for Computer
Vision", International Journal of Computer Vision 30 (1998), section 4.
"""

from __future__ import annotations

import math

import numpy as np

from analysis.models.base import Model, Validity
from analysis.models.lambert import ALBEDO
from analysis.models.rough.oren_nayar_forms import (
    SIGMA_DEG,
    roughness_terms,
    sigma_terms_gradient,
)
from analysis.models.smooth.interface import both_transmittances, both_with_gradient
from analysis.models.smooth.wolff import N
from analysis.models.validity import GRAZING, NEGATIVE, both_graze, valid_except
from instrument.geometry import FloatArray, Geometry

TRANSITION_DEG = (9.0, 36.0)
"""Roughness between which 1998 (figure 16) sees smooth and rough effects of like size: C1 is ten
times the upper bound of C2 and C3 at the lower end, twice at the upper one. The authors leave the
upper end open, between 17 (four times) and 36 degrees."""

_TOO_ROUGH = f"rougher than the transition range, which ends at {TRANSITION_DEG[1]:g} degrees"


def wolff_oren_nayar_brdf(
    geometry: Geometry, albedo: float, sigma_deg: float, n: float, epsilon: float | None = None
) -> FloatArray:
    """Smooth and rough combined: 1998, equation (3) with C1 of (9), over L_i cos(theta_i).

    Arguments and result as in `Model.brdf`. C2 and C3 as in (3), no interreflection (4).
    `sigma_deg` is the standard deviation of the facets' slope angle. Reciprocal. At sigma = 0 it
    is (7) with varrho = albedo/pi; at n = 1 it is (3). With an `epsilon` both F of C1 are Wolff's
    polynomial. As printed it is negative far forward, where C1 vanishes and C2 does not.
    """
    sigma2 = math.radians(sigma_deg) ** 2
    C1 = (1 - 0.5 * sigma2 / (sigma2 + 0.33)) * both_transmittances(geometry, n, epsilon)
    rough = sigma2 / (sigma2 + 0.09) * roughness_terms(geometry)
    return np.asarray((albedo / np.pi) * (C1 + rough))


def wolff_oren_nayar_gradient(
    geometry: Geometry, albedo: float, sigma_deg: float, n: float
) -> dict[str, FloatArray]:
    """Derivatives of `wolff_oren_nayar_brdf` by albedo, sigma and n. As in `Model.gradient`."""
    sigma2 = math.radians(sigma_deg) ** 2
    T, dT = both_with_gradient(geometry, n)
    (dC1, d_rough), terms = sigma_terms_gradient(sigma_deg), roughness_terms(geometry)
    C1, rough = 1 - 0.5 * sigma2 / (sigma2 + 0.33), sigma2 / (sigma2 + 0.09)
    return {
        "albedo": (C1 * T + rough * terms) / np.pi,
        "sigma_deg": (albedo / np.pi) * (dC1 * T + d_rough * terms),
        "n": (albedo / np.pi) * C1 * dT,
    }


def wolff_oren_nayar_validity(
    geometry: Geometry, albedo: float, sigma_deg: float, n: float
) -> Validity:
    """Valid up to the end of the transition range, where not negative and finite.

    Arguments as in `Model.brdf`.
    """
    del albedo  # validity does not depend on it
    return valid_except(
        geometry,
        (sigma_deg > TRANSITION_DEG[1], _TOO_ROUGH),
        (wolff_oren_nayar_brdf(geometry, 1.0, sigma_deg, n) < 0, NEGATIVE),
        (both_graze(geometry) & (sigma_deg > 0), GRAZING),
    )


def roughness_share(sigma_deg: float) -> float:
    """Upper bound of C2 and C3 over C1 at normal incidence without an interface: 1998, figure 16.

    0.45 sigma^2/(sigma^2 + 0.09) / (1 - 0.5 sigma^2/(sigma^2 + 0.33)): 1/100, 1/20, 1/10 near
    2.5, 6 and 9 degrees, and 1/4, 1/3, 1/2 near 17, 22 and 36 degrees. Library only.
    """
    sigma2 = math.radians(sigma_deg) ** 2
    return 0.45 * sigma2 / (sigma2 + 0.09) / (1 - 0.5 * sigma2 / (sigma2 + 0.33))


WOLFF_OREN_NAYAR = Model(
    "wolff_oren_nayar",
    (ALBEDO, SIGMA_DEG, N),
    wolff_oren_nayar_brdf,
    wolff_oren_nayar_gradient,
    wolff_oren_nayar_validity,
)
