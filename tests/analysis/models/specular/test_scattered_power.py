"""Scattered power and radiance, against 1991's equations typed as printed (brackets mended)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.models import MODELS
from analysis.models.specular.scattered_power import (
    Patch,
    Surface,
    general_power,
    general_radiance,
    irradiance,
    patch_of_pixel,
    rough_power,
    rough_radiance,
    smooth_power,
    smooth_radiance,
)
from instrument.geometry import Geometry

ANGLE = st.floats(1.0, 80.0)
AZIMUTH = st.floats(1.0, 179.0)


@dataclass
class Printed:
    """(16), (19)-(22) in radians, with 1991's azimuth, in wavelengths."""

    i: float
    r: float
    p: float
    sigma_h: float
    T: float
    X: float
    Y: float

    def __post_init__(self) -> None:
        k, i, r, phi = 2 * math.pi, self.i, self.r, self.p - math.pi
        v_x = k * (math.sin(i) - math.sin(r) * math.cos(phi))
        v_y = k * math.sin(r) * math.sin(phi)
        self.v_z = -k * (math.cos(i) + math.cos(r))
        self.v2, self.A = v_x**2 + v_y**2, 4 * self.X * self.Y
        self.g = (2 * math.pi * self.sigma_h * (math.cos(i) + math.cos(r))) ** 2
        x, y = v_x * self.X, v_y * self.Y
        self.rho0 = math.sin(x) / x * math.sin(y) / y
        self.D = (1 + math.cos(i) * math.cos(r) - math.sin(i) * math.sin(r) * math.cos(phi)) / (
            math.cos(i) * (math.cos(i) + math.cos(r))
        )

    def series(self) -> float:
        return sum(
            self.g**m / (math.factorial(m) * m) * math.exp(-self.v2 * self.T**2 / (4 * m))
            for m in range(1, 100)
        )

    def of(self, terms: float) -> float:
        """(18) or (23) of the sum, or of its first term."""
        bracket = self.rho0**2 + math.pi * self.T**2 * self.D**2 / self.A * terms
        return self.A**2 * math.cos(self.i) ** 2 * math.exp(-self.g) * bracket

    def radiance(self, terms: float) -> float:
        """(27) or (28), the viewed area (73) written as A."""
        c = math.cos(self.r)
        spike = self.A * c / c**2 * self.rho0**2  # (z/f)^2 dA_im cos(gamma) = A cos_r
        lobe = math.pi * self.T**2 * self.D**2 / c * terms
        return math.cos(self.i) ** 2 * math.exp(-self.g) * (spike + lobe)

    def rough(self) -> float:
        """(24) over A, which is (29) times cos_r."""
        z = self.v_z**2 * self.sigma_h**2
        peak = math.cos(self.i) ** 2 * math.pi * self.T**2 * self.D**2 / z
        return peak * math.exp(-self.v2 * self.T**2 / (4 * z))


@given(i=ANGLE, r=ANGLE, p=AZIMUTH, sigma_h=st.floats(0.01, 0.25))
def test_power_and_radiance_as_printed(i: float, r: float, p: float, sigma_h: float) -> None:
    geometry = Geometry.from_degrees(theta_i=i, theta_r=r, dphi=p)
    surface, patch = Surface(sigma_h, 1.5), Patch(0.7, 0.4)
    printed = Printed(*map(math.radians, (i, r, p)), *surface, *patch)
    first = printed.g * math.exp(-printed.v2 * 1.5**2 / 4)
    near = {"rel": 1e-9, "abs": 1e-14}
    assert general_power(geometry, surface, patch) == pytest.approx(
        printed.of(printed.series()), **near
    )
    assert smooth_power(geometry, surface, patch) == pytest.approx(printed.of(first), **near)
    assert general_radiance(geometry, surface, patch) == pytest.approx(
        printed.radiance(printed.series()), **near
    )
    assert smooth_radiance(geometry, surface, patch) == pytest.approx(
        printed.radiance(first), **near
    )


@given(i=ANGLE, r=ANGLE, p=AZIMUTH, sigma_h=st.floats(0.5, 20.0))
def test_the_very_rough_surface_as_printed(i: float, r: float, p: float, sigma_h: float) -> None:
    geometry = Geometry.from_degrees(theta_i=i, theta_r=r, dphi=p)
    surface, patch = Surface(sigma_h, 4 * sigma_h), Patch(0.7, 0.4)
    printed = Printed(*map(math.radians, (i, r, p)), *surface, *patch)
    expected = printed.rough()
    assert rough_power(geometry, surface, patch) == pytest.approx(
        printed.A * expected, rel=1e-9, abs=1e-280
    )
    assert rough_radiance(geometry, surface) * math.cos(math.radians(r)) == pytest.approx(
        expected, rel=1e-9, abs=1e-280
    )


def test_the_limits_agree_with_the_general_form() -> None:
    """g = 1e-6: the first term is all; g = 632 and more: (53) for (52), to 2/g near the mirror."""
    geometry = Geometry.from_degrees(theta_i=[0.0, 30.0, 60.0], theta_r=[1.0, -31.0, -60.5])
    patch = Patch(2.0, 3.0)
    flat, wavy = Surface(1e-4, 3.0), Surface(4.0, 40.0)
    np.testing.assert_allclose(
        smooth_radiance(geometry, flat, patch), general_radiance(geometry, flat, patch), rtol=1e-6
    )
    np.testing.assert_allclose(
        rough_radiance(geometry, wavy), general_radiance(geometry, wavy, patch), rtol=2 / 600
    )


def test_radiance_over_irradiance_is_the_brdf() -> None:
    geometry = Geometry.from_degrees(theta_i=[10.0, 70.0], theta_r=[[20.0], [65.0]], dphi=170.0)
    surface = Surface(0.3, 6.0)
    lobe = MODELS["beckmann_spizzichino"].brdf(
        geometry, scale=1.0, sigma_h=surface.sigma_h, correlation_length=surface.correlation_length
    )
    nothing_resolved = general_radiance(geometry, surface, Patch(1e-9, 1e-9))
    np.testing.assert_allclose(nothing_resolved / irradiance(geometry), lobe, rtol=1e-12)
    assert general_power(geometry, surface, Patch(2.0, 3.0)).shape == (2, 2)


def test_the_patch_of_a_pixel() -> None:
    # (73): a pixel of 10 by 10 wavelengths, 20 focal lengths away, sees 4e4 straight on
    areas = [
        patch_of_pixel(10.0, 20.0, gamma, np.radians(theta_r)).area
        for gamma, theta_r in ((0.0, 0.0), (0.0, 60.0), (60.0, 60.0))
    ]
    assert areas == pytest.approx([4e4, 8e4, 4e4])
    slanted = patch_of_pixel(10.0, 20.0, 0.0, np.radians(60.0))
    assert pytest.approx(2 * slanted.Y) == slanted.X
    with pytest.raises(ValueError, match="theta_r up to 90 degrees; allowed: below 90 degrees"):
        patch_of_pixel(10.0, 20.0, 0.0, np.radians(90.0))


def test_a_mirror_is_equally_bright_at_any_incidence() -> None:
    """1991, after Fig. 9: below sigma_h = 0.025 the radiance in the mirror direction is the same
    for all theta_i, as the pixel's patch grows by 1/cos while (27) has cos_i^2 / cos_r^2.
    """
    for theta in (0.0, 30.0, 60.0):
        mirror = Geometry.from_degrees(theta_i=theta, theta_r=-theta)
        patch = patch_of_pixel(10.0, 20.0, 0.0, np.radians(theta))
        found = general_radiance(mirror, Surface(1e-5, 10.0), patch)
        assert found == pytest.approx(4e4, rel=1e-6)
