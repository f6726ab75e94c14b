"""The printed models of Oren and Nayar, with their validity: `oren_nayar` and its qualitative form.

The formulas (33), (34) and (36) stand in `oren_nayar_forms`. This module adds where they are
valid: not negative, finite, and within a fifth of the exact integral (`form_bounds`).

Source: M. Oren, S. K. Nayar, "Generalization of the Lambertian Model and Implications for Machine
Vision", International Journal of Computer Vision 14 (1995), sections 4.3 and 4.4.
"""

from __future__ import annotations

import math

import numpy as np

from analysis.models.base import Model, Validity
from analysis.models.lambert import ALBEDO
from analysis.models.rough.form_bounds import tight_bound
from analysis.models.rough.oren_nayar_forms import (
    PRINTED,
    SIGMA_DEG,
    oren_nayar_brdf,
    oren_nayar_gradient,
    oren_nayar_qualitative_brdf,
    oren_nayar_qualitative_gradient,
    relative_to_lambert,
    roughness_terms,
)
from analysis.models.validity import GRAZING, NEGATIVE, both_graze, valid_except
from instrument.geometry import BoolArray, Geometry

VALID = 0.2
"""Largest relative error against the integral at which a printed form counts as valid."""

_OFF = "more than a fifth off the integral: shadow, masking and interreflection beyond the fit"
_UNKNOWN = "nearer to grazing than 85 degrees, where the error against the integral is not mapped"
_FORWARD = "forward, where (36) leaves out more than a fifth of itself: up to twice the integral"


def oren_nayar_qualitative_validity(
    geometry: Geometry, albedo: float, sigma_deg: float, constant: float = PRINTED
) -> Validity:
    """Validity of (36): not far forward, where (33) has a negative C2 that (36) leaves out.

    With the printed constant also within a fifth of the integral, as far as that is mapped.
    Arguments as in `Model.brdf`.
    """
    printed = constant == PRINTED
    sigma2 = math.radians(sigma_deg) ** 2
    A = 1 - 0.5 * sigma2 / (sigma2 + constant)
    left_out = -sigma2 / (sigma2 + 0.09) * roughness_terms(geometry)
    return valid_except(
        geometry,
        ((geometry.cos_dphi < 0) & (left_out > 0.2 * A), _FORWARD),
        (both_graze(geometry) & (geometry.cos_dphi >= 0) & (sigma2 > 0), GRAZING),
        *(_form_errors("oren_nayar_qualitative", geometry, albedo, sigma_deg) if printed else ()),
    )


def oren_nayar_validity(geometry: Geometry, albedo: float, sigma_deg: float) -> Validity:
    """Validity of (33) + (34): not negative, finite, and within a fifth of the integral.

    The last as far as it is mapped. Arguments as in `Model.brdf`.
    """
    return valid_except(
        geometry,
        (relative_to_lambert(geometry, albedo, sigma_deg) < 0, NEGATIVE),
        (both_graze(geometry) & (sigma_deg > 0), GRAZING),
        *_form_errors("oren_nayar", geometry, albedo, sigma_deg),
    )


def _form_errors(
    name: str, geometry: Geometry, albedo: float, sigma_deg: float
) -> tuple[tuple[BoolArray, str], ...]:
    """Geometries where a form may be off the integral by more than VALID or is not mapped."""
    if sigma_deg == 0:
        return ()  # a plane: all forms are Lambert's law
    ranges = {"albedo": (albedo, albedo), "sigma_deg": (sigma_deg, sigma_deg)}
    bound = tight_bound(name, geometry, ranges)
    return (np.isfinite(bound) & (bound > VALID), _OFF), (np.isinf(bound), _UNKNOWN)


OREN_NAYAR_QUALITATIVE = Model(
    "oren_nayar_qualitative",
    (ALBEDO, SIGMA_DEG),
    oren_nayar_qualitative_brdf,
    oren_nayar_qualitative_gradient,
    oren_nayar_qualitative_validity,
)
OREN_NAYAR = Model(
    "oren_nayar", (ALBEDO, SIGMA_DEG), oren_nayar_brdf, oren_nayar_gradient, oren_nayar_validity
)
