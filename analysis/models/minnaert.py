"""Minnaert's reciprocal law of darkening towards the limb or the terminator.

What to use when: to compare with work that used it. It is empirical and does not depend on azimuth.

Source: M. Minnaert, "The Reciprocity Principle in Lunar Photometry", Astrophysical Journal 93
(1941), as quoted by Oren and Nayar 1995, section 1, times an albedo.
"""

from __future__ import annotations

import numpy as np

from analysis.models.base import Model, Parameter, Validity
from analysis.models.lambert import ALBEDO
from analysis.models.validity import valid_except
from instrument.geometry import FloatArray, Geometry

K = Parameter("k", "1", 0.0, 2.0, 1.0)

_BEYOND_PAPER = "k above 1: the paper gives 0 to 1"
_TOO_BRIGHT = (
    "so oblique that more light would leave than arrives: albedo cos(theta)^(k - 1) above 1"
)


def minnaert_brdf(geometry: Geometry, albedo: float, k: float) -> FloatArray:
    """Minnaert's BRDF: albedo (k + 1)/(2 pi) (cos(theta_i) cos(theta_r))^(k - 1).

    Arguments and result as in `Model.brdf`. Reciprocal; Lambert's at k = 1. As printed it grows
    without limit towards grazing for k < 1. It reflects the fraction albedo cos(theta_i)^(k - 1) of
    the light from theta_i, so that it conserves energy at every incidence for k >= 1 only.
    """
    return np.asarray(albedo * (k + 1) / (2 * np.pi) * np.power(_product(geometry), k - 1))


def minnaert_gradient(geometry: Geometry, albedo: float, k: float) -> dict[str, FloatArray]:
    """Derivatives of `minnaert_brdf` by albedo and by k. As in `Model.gradient`."""
    product = _product(geometry)
    power = np.power(product, k - 1) / (2 * np.pi)
    return {
        "albedo": np.asarray((k + 1) * power),
        "k": np.asarray(albedo * power * (1 + (k + 1) * np.log(product))),
    }


def minnaert_validity(geometry: Geometry, albedo: float, k: float) -> Validity:
    """Valid for the paper's k, where no more light leaves than arrives, in either direction.

    Arguments as in `Model.brdf`.
    """
    least = np.minimum(np.cos(geometry.theta_i), np.cos(geometry.theta_r))
    return valid_except(
        geometry,
        (k > 1, _BEYOND_PAPER),
        (albedo * np.power(least, k - 1) > 1, _TOO_BRIGHT),
    )


def _product(geometry: Geometry) -> FloatArray:
    """cos(theta_i) cos(theta_r): 4e-33, not 0, at 90 degrees twice, as pi/2 is rounded."""
    return np.asarray(np.cos(geometry.theta_i) * np.cos(geometry.theta_r))


MINNAERT = Model("minnaert", (ALBEDO, K), minnaert_brdf, minnaert_gradient, minnaert_validity)
