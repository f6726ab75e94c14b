"""Oren and Nayar's functional form with a weight of its interreflection.

What to use when: surfaces so rough that Gaussian slopes no longer describe them; the papers offer
the weight for these, as an empirical parameter (1995, after (35); 1998, section 3.1: (4) against
(3)). With a weight of 1 it is `oren_nayar`. Albedo and weight are told apart by
the shape of the two parts alone: a fit needs several incidences, or a known albedo.

Sources: M. Oren, S. K. Nayar, International Journal of Computer Vision 14 (1995), section 4.3;
L. B. Wolff, S. K. Nayar, M. Oren, International Journal of Computer Vision 30 (1998), section 3.1.
"""

from __future__ import annotations

import numpy as np

from analysis.models.base import Model, Parameter, Validity
from analysis.models.lambert import ALBEDO
from analysis.models.rough.oren_nayar_forms import (
    SIGMA_DEG,
    oren_nayar_gradient,
    relative_to_lambert,
)
from analysis.models.validity import GRAZING, NEGATIVE, both_graze, valid_except
from instrument.geometry import FloatArray, Geometry

INTERREFLECTION = Parameter("interreflection", "1", 0.0, 5.0, 1.0, starts=(0.0, 1.0, 3.0))


def weighted_brdf(
    geometry: Geometry, albedo: float, sigma_deg: float, interreflection: float
) -> FloatArray:
    """BRDF of (33) + interreflection (34): 1995, over E0 cos(theta_i). As in `Model.brdf`.

    Reciprocal; Lambert's at sigma = 0. Negative where `oren_nayar_brdf` is: far forward.
    """
    direct, twice = _parts(geometry, albedo, sigma_deg)
    return np.asarray((albedo / np.pi) * (direct + interreflection * twice))


def weighted_gradient(
    geometry: Geometry, albedo: float, sigma_deg: float, interreflection: float
) -> dict[str, FloatArray]:
    """Derivatives of `weighted_brdf` by its parameters. As in `Model.gradient`."""
    direct, twice = _parts(geometry, albedo, sigma_deg)
    # (33) rises as the albedo, (34) as its square: both follow from the form at two albedos.
    whole, half = (oren_nayar_gradient(geometry, a, sigma_deg)["sigma_deg"] for a in (1.0, 0.5))
    d_direct, d_twice = 4 * half - whole, 2 * whole - 4 * half
    return {
        "albedo": (direct + 2 * interreflection * twice) / np.pi,
        "sigma_deg": albedo * (d_direct + interreflection * albedo * d_twice),
        "interreflection": (albedo / np.pi) * twice,
    }


def _parts(geometry: Geometry, albedo: float, sigma_deg: float) -> tuple[FloatArray, FloatArray]:
    """(33) and (34) over albedo/pi."""
    direct = relative_to_lambert(geometry, 0.0, sigma_deg)
    return direct, relative_to_lambert(geometry, albedo, sigma_deg) - direct


def weighted_validity(
    geometry: Geometry, albedo: float, sigma_deg: float, interreflection: float
) -> Validity:
    """Validity: not negative, and finite. Arguments as in `Model.brdf`."""
    direct, twice = _parts(geometry, albedo, sigma_deg)
    return valid_except(
        geometry,
        (direct + interreflection * twice < 0, NEGATIVE),
        (both_graze(geometry) & (sigma_deg > 0), GRAZING),
    )


OREN_NAYAR_WEIGHTED = Model(
    "oren_nayar_weighted",
    (ALBEDO, SIGMA_DEG, INTERREFLECTION),
    weighted_brdf,
    weighted_gradient,
    weighted_validity,
)
