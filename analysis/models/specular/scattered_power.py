"""Beckmann and Spizzichino's scattered power, and the radiance that a camera measures from it.

What to use when: to follow the paper, or for a camera that resolves the spike. Library only: a fit
uses the BRDF (`beckmann_spizzichino`), which is `general_radiance` over `irradiance`. The spike
depends on the area imaged by a pixel, (73), the lobe does not. Arguments and results have the
geometry's shape and broadcast with `Patch`.

====================  ================  =======================
                      scattered power   radiance
====================  ================  =======================
any roughness         (18)              (27) = (52) = (77)
smooth, g << 1        (23)              (28) = (78)
very rough, g >> 1    (24)              (29) = (53) = (79)
====================  ================  =======================

Lengths are in wavelengths. Powers are in units of E_01^2 lambda^2 / R_0^2; radiance and irradiance
in units of the power (68) per unit area of the incident wave, (eps/mu)^1/2 E_01^2 / 2
(errata: printed with the root inverted; it cancels in the BRDF).

Source: S. K. Nayar, K. Ikeuchi, T. Kanade, IEEE Transactions on Pattern Analysis and Machine
Intelligence 13 (1991); the brackets of (18) and the vector (16) corrected as in `wave_vector`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from analysis.models.specular.beckmann_spizzichino import (
    lobe_brdf,
    rough_lobe_brdf,
    smooth_lobe_brdf,
    spike_brdf,
)
from instrument.geometry import FloatArray, Geometry


class Surface(NamedTuple):
    """Standard deviation of the height and correlation length T, both in wavelengths."""

    sigma_h: float
    correlation_length: float


class Patch(NamedTuple):
    """Half the sides of the area imaged by a pixel, in wavelengths; X in the plane of incidence."""

    X: FloatArray | float
    Y: FloatArray | float

    @property
    def area(self) -> FloatArray | float:
        """A = 4XY in square wavelengths, scalar or array."""
        return 4 * self.X * self.Y


def patch_of_pixel(
    side: float, distance_over_focal_length: float, gamma_deg: float, theta_r: FloatArray
) -> Patch:
    """Patch imaged by a square pixel: its area is (73), dA_s = dA_im (cos gamma / cos_r) (z/f)^2.

    `side` is the pixel's in wavelengths, gamma its angle from the optical axis, theta_r in radians,
    any shape. The patch is elongated along X. Raises `ValueError` for an angle that reaches 90
    degrees.
    """
    gamma = math.radians(gamma_deg)
    if abs(gamma_deg) >= 90 or np.any(np.abs(theta_r) >= np.pi / 2):
        raise ValueError(
            f"gamma = {gamma_deg:g} degrees, theta_r up to "
            f"{np.degrees(np.max(np.abs(theta_r))):g} degrees; allowed: below 90 degrees"
        )
    half = side * distance_over_focal_length / 2
    return Patch(half * math.cos(gamma) / np.cos(theta_r), half)


def irradiance(geometry: Geometry) -> FloatArray:
    """I_s, of the geometry's shape, in units of (68): 1991, (80)."""
    return np.cos(geometry.theta_i)


def general_power(geometry: Geometry, surface: Surface, patch: Patch) -> FloatArray:
    """<E2 E2*>: 1991, (18), A^2 cos_i^2 e^-g (rho_0^2 + (pi T^2 D^2/A) sum g^m/(m! m) e^(-q/m)).

    Of the geometry's shape, units of the module.
    """
    return _power_per_radiance(geometry, patch) * general_radiance(geometry, surface, patch)


def smooth_power(geometry: Geometry, surface: Surface, patch: Patch) -> FloatArray:
    """<E2 E2*> for g << 1: 1991, (23), the sum's first term; shape and unit as `general_power`."""
    return _power_per_radiance(geometry, patch) * smooth_radiance(geometry, surface, patch)


def rough_power(geometry: Geometry, surface: Surface, patch: Patch) -> FloatArray:
    """<E2 E2*> for g >> 1: 1991, (24), no spike; shape and unit as `general_power`, sigma_h > 0."""
    return _power_per_radiance(geometry, patch) * rough_radiance(geometry, surface)


def general_radiance(geometry: Geometry, surface: Surface, patch: Patch) -> FloatArray:
    """L_r: 1991, (27), (52) and (77), with (z/f)^2 dA_im cos gamma / cos_r = A of the patch.

    Of the geometry's shape, units of the module. The paper sums 100 terms for (52), which is too
    few from g = 70 on: here as many as needed.
    """
    lobe = lobe_brdf(geometry, 1.0, *surface)
    return irradiance(geometry) * (_spike(geometry, surface, patch) + lobe)


def smooth_radiance(geometry: Geometry, surface: Surface, patch: Patch) -> FloatArray:
    """L_r for g << 1: 1991, (28) and (78); shape and unit as `general_radiance`."""
    lobe = smooth_lobe_brdf(geometry, 1.0, *surface)
    return irradiance(geometry) * (_spike(geometry, surface, patch) + lobe)


def rough_radiance(geometry: Geometry, surface: Surface) -> FloatArray:
    """L_r for g >> 1: 1991, (29), (53) and (79), no spike; shape and unit as `general_radiance`.

    `sigma_h` is above 0.
    """
    return irradiance(geometry) * rough_lobe_brdf(geometry, 1.0, *surface)


def _spike(geometry: Geometry, surface: Surface, patch: Patch) -> FloatArray:
    return spike_brdf(geometry, 1.0, surface.sigma_h, patch.X, patch.Y)


def _power_per_radiance(geometry: Geometry, patch: Patch) -> FloatArray:
    """Power per radiance: A cos_r, from (76) with (73)."""
    return np.asarray(patch.area * np.cos(geometry.theta_r))
