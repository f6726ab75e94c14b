"""Beckmann and Spizzichino's scattered power, and the radiance that a camera makes of it.

What to use when: to follow the paper, or a camera that resolves the spike. A fit uses the BRDF
(`beckmann_spizzichino`), which is `general_radiance` over `irradiance`; its spike depends on the
area that a pixel sees, (73), its lobe does not.

====================  ================  =======================
                      scattered power   radiance
====================  ================  =======================
any roughness         (18)              (27) = (52) = (77)
smooth, g << 1        (23)              (28) = (78)
very rough, g >> 1    (24)              (29) = (53) = (79)
====================  ================  =======================

Lengths are in wavelengths. Powers are in units of E_01^2 lambda^2 / R_0^2; radiance and irradiance
in units of the power (68) that crosses a unit area of the incident wave, (eps/mu)^1/2 E_01^2 / 2
(errata: printed with the root turned over; it stands in both and cancels in the BRDF).

Source: S. K. Nayar, K. Ikeuchi, T. Kanade, IEEE Transactions on Pattern Analysis and Machine
Intelligence 13 (1991); the brackets of (18) and the vector (16) mended as in `wave_vector`.
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
    """Half the sides of the area that a pixel sees, in wavelengths; X in the plane of incidence."""

    X: FloatArray | float
    Y: FloatArray | float

    @property
    def area(self) -> FloatArray | float:
        """A = 4XY in square wavelengths."""
        return 4 * self.X * self.Y


def patch_of_pixel(
    side: float, distance_over_focal_length: float, gamma_deg: float, theta_r: FloatArray
) -> Patch:
    """Patch that a square pixel sees: its area is (73), dA_s = dA_im (cos gamma / cos_r) (z/f)^2.

    `side` is the pixel's in wavelengths, gamma its angle from the optical axis, theta_r in radians.
    It is drawn out along X. Raises `ValueError` for an angle that reaches 90 degrees.
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
    """I_s: 1991, (80)."""
    return np.cos(geometry.theta_i)


def general_power(geometry: Geometry, surface: Surface, patch: Patch) -> FloatArray:
    """<E2 E2*>: 1991, (18), A^2 cos_i^2 e^-g (rho_0^2 + (pi T^2 D^2/A) sum g^m/(m! m) e^(-q/m))."""
    return _collected(geometry, patch) * general_radiance(geometry, surface, patch)


def smooth_power(geometry: Geometry, surface: Surface, patch: Patch) -> FloatArray:
    """<E2 E2*> for g << 1: 1991, (23), the sum's first term."""
    return _collected(geometry, patch) * smooth_radiance(geometry, surface, patch)


def rough_power(geometry: Geometry, surface: Surface, patch: Patch) -> FloatArray:
    """<E2 E2*> for g >> 1: 1991, (24), without a spike. `sigma_h` is above 0."""
    return _collected(geometry, patch) * rough_radiance(geometry, surface)


def general_radiance(geometry: Geometry, surface: Surface, patch: Patch) -> FloatArray:
    """L_r: 1991, (27), (52) and (77), with (z/f)^2 dA_im cos gamma / cos_r = A of the patch.

    The paper sums 100 terms for (52), which is too few from g = 70 on: here as many as it takes.
    """
    lobe = lobe_brdf(geometry, 1.0, *surface)
    return irradiance(geometry) * (_spike(geometry, surface, patch) + lobe)


def smooth_radiance(geometry: Geometry, surface: Surface, patch: Patch) -> FloatArray:
    """L_r for g << 1: 1991, (28) and (78)."""
    lobe = smooth_lobe_brdf(geometry, 1.0, *surface)
    return irradiance(geometry) * (_spike(geometry, surface, patch) + lobe)


def rough_radiance(geometry: Geometry, surface: Surface) -> FloatArray:
    """L_r for g >> 1: 1991, (29), (53) and (79); no spike is left. `sigma_h` is above 0."""
    return irradiance(geometry) * rough_lobe_brdf(geometry, 1.0, *surface)


def _spike(geometry: Geometry, surface: Surface, patch: Patch) -> FloatArray:
    return spike_brdf(geometry, 1.0, surface.sigma_h, patch.X, patch.Y)


def _collected(geometry: Geometry, patch: Patch) -> FloatArray:
    """Power per radiance: A cos_r, from (76) with (73)."""
    return np.asarray(patch.area * np.cos(geometry.theta_r))
