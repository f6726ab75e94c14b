"""The printed forms of Oren and Nayar: formulas typed from the paper, limits, energy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.models import MODELS
from analysis.models.rough.oren_nayar import oren_nayar_qualitative_validity
from analysis.models.rough.oren_nayar_forms import (
    oren_nayar_qualitative_brdf,
    oren_nayar_qualitative_gradient,
)
from instrument.geometry import Geometry
from tests.support.models.derivatives import central_difference
from tests.support.models.geometries import (
    random_directions,
)
from tests.support.models.printed_forms import printed_functional, printed_qualitative
from tests.support.models.reflectance import hemispherical_reflectance

ANGLE = st.floats(0.0, 88.0)
AZIMUTH = st.floats(0.0, 360.0)
PART = st.floats(0.0, 1.0)


@pytest.mark.parametrize(
    ("name", "printed"),
    [("oren_nayar", printed_functional), ("oren_nayar_qualitative", printed_qualitative)],
)
@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, albedo=PART, sigma=st.floats(0.0, 60.0))
def test_the_printed_formula(
    name: str, printed: object, theta_i: float, theta_r: float, dphi: float, albedo: float,
    sigma: float,
) -> None:  # fmt: skip
    assert callable(printed)
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    expected = printed(*map(math.radians, (theta_i, theta_r, dphi)), albedo, math.radians(sigma))
    found = MODELS[name].brdf(geometry, albedo=albedo, sigma_deg=sigma)
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("name", ["oren_nayar", "oren_nayar_qualitative"])
@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, albedo=PART)
def test_a_smooth_surface_is_lambertian(
    name: str, theta_i: float, theta_r: float, dphi: float, albedo: float
) -> None:
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    found = MODELS[name].brdf(geometry, albedo=albedo, sigma_deg=0.0)
    np.testing.assert_allclose(found, MODELS["lambert"].brdf(geometry, albedo=albedo), rtol=1e-14)


def test_the_functional_model_is_negative_far_forward_as_printed() -> None:
    # errata: at sigma 60 degrees the direct term (33) is negative from 77/77 degrees on
    geometry = Geometry.from_degrees(theta_i=80, theta_r=80, dphi=180)
    assert MODELS["oren_nayar"].brdf(geometry, albedo=0.1, sigma_deg=60) < 0


def test_the_qualitative_model_forward_as_in_the_errata() -> None:
    # errata: sigma 30 degrees, 75/60 opposite sides: 0.773 per albedo / pi
    geometry = Geometry.from_degrees(theta_i=75, theta_r=60, dphi=180)
    found = MODELS["oren_nayar_qualitative"].brdf(geometry, albedo=1, sigma_deg=30) * np.pi
    assert found == pytest.approx(0.773, abs=5e-4)


def test_the_constant_of_footnote_11() -> None:
    # 1995, footnote 11: 0.57 for 0.33 in A partly makes up for interreflection: brighter
    geometry = random_directions(30)
    sigma2 = math.radians(30.0) ** 2
    usual = oren_nayar_qualitative_brdf(geometry, 0.9, 30.0)
    brighter = oren_nayar_qualitative_brdf(geometry, 0.9, 30.0, constant=0.57)
    expected = 0.9 / np.pi * 0.5 * sigma2 * (1 / (sigma2 + 0.33) - 1 / (sigma2 + 0.57))
    np.testing.assert_allclose(brighter - usual, expected, rtol=1e-12)
    expected = central_difference(
        lambda sigma: oren_nayar_qualitative_brdf(geometry, 0.9, sigma, 0.57), 30.0, 1e-3
    )
    gradient = oren_nayar_qualitative_gradient(geometry, 0.9, 30.0, constant=0.57)
    np.testing.assert_allclose(gradient["sigma_deg"], expected, rtol=1e-6, atol=1e-10)
    assert oren_nayar_qualitative_validity(geometry, 0.9, 5.0, constant=0.57).mask.any()


@pytest.mark.parametrize(
    ("name", "sigma_deg", "most"),
    [("oren_nayar_qualitative", 11.0, 1.015), ("oren_nayar", 17.0, 1.051)],
)
def test_reflectance_above_1_is_as_documented(name: str, sigma_deg: float, most: float) -> None:
    most_found = hemispherical_reflectance(name, 90.0, albedo=1.0, sigma_deg=sigma_deg)
    assert most_found == pytest.approx(most, abs=6e-4)
    for theta_i in (0.0, 40.0, 80.0, 90.0):
        for sigma in (3.0, sigma_deg, 40.0, 60.0):
            found = hemispherical_reflectance(name, theta_i, albedo=1.0, sigma_deg=sigma)
            assert found < most + 6e-4
