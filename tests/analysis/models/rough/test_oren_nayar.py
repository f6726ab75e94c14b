"""Validity of the printed forms of Oren and Nayar."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.accuracy.cheapest import cheapest
from analysis.accuracy.rough_surface import ROUGH_SURFACE
from analysis.models import MODELS
from analysis.models.rough.oren_nayar import VALID
from instrument.geometry import Geometry

FORMS = ["oren_nayar_qualitative", "oren_nayar"]


def largest_error(name: str, geometry: Geometry, values: dict[str, float]) -> float:
    """Largest relative error of a form against the integral."""
    exact = MODELS["oren_nayar_exact"].brdf(geometry, **values)
    return float(np.max(np.abs(MODELS[name].brdf(geometry, **values) / exact - 1), initial=0.0))


@pytest.mark.parametrize("name", FORMS)
@settings(max_examples=20)
@given(
    albedo=st.floats(0.001, 1), sigma_deg=st.floats(0.1, 60), seed=st.integers(0, 2**32 - 1)
)  # fmt: skip
def test_where_a_form_is_valid_it_is_within_a_fifth(
    name: str, albedo: float, sigma_deg: float, seed: int
) -> None:
    random = np.random.default_rng(seed)
    theta_i, theta_r = random.uniform(0, 90, (2, 40))
    dphi = random.choice([0.0, 180.0, 170.0, 60.0], 40)
    values = {"albedo": albedo, "sigma_deg": sigma_deg}
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    holds = MODELS[name].validity(geometry, **values).mask
    inside = Geometry.from_degrees(theta_i=theta_i[holds], theta_r=theta_r[holds], dphi=dphi[holds])
    assert largest_error(name, inside, values) <= VALID


@pytest.mark.parametrize(
    ("name", "theta_i", "theta_r"),
    [("oren_nayar", 75.0, -75.0), ("oren_nayar_qualitative", 60.0, -60.0)],
)
def test_where_a_form_is_invalid_another_method_is_chosen(
    name: str, theta_i: float, theta_r: float
) -> None:
    there = Geometry.from_degrees(theta_i=[theta_i], theta_r=[theta_r])
    values = {"albedo": 0.01, "sigma_deg": 30.0}
    assert largest_error(name, there, values) > VALID
    validity = MODELS[name].validity(there, **values)
    assert not validity.mask.any()
    assert "off the integral" in validity.reason
    ranges = {parameter: (value, value) for parameter, value in values.items()}
    method = name.removeprefix("oren_nayar_").replace("oren_nayar", "functional")
    assert cheapest(ROUGH_SURFACE, there, ranges, VALID, among=[method]).method == "fine"


def test_angles_beyond_the_map_are_invalid() -> None:
    grazing = Geometry.from_degrees(theta_i=[84.0, 86.0], theta_r=10.0)
    validity = MODELS["oren_nayar"].validity(grazing, albedo=0.5, sigma_deg=5.0)
    assert list(validity.mask) == [True, False]
    assert "not mapped" in validity.reason
    # All forms agree on a plane.
    assert MODELS["oren_nayar"].validity(grazing, albedo=0.5, sigma_deg=0.0).mask.all()


def test_limits_of_the_functional_form() -> None:
    # errata: negative far forward, at 45 degrees from 84/84 and at 60 degrees from 77/77 on
    model = MODELS["oren_nayar"]
    for sigma_deg, from_deg in ((45.0, 84), (60.0, 77)):
        geometry = Geometry.from_degrees(
            theta_i=[from_deg - 1, from_deg], theta_r=[1 - from_deg, -from_deg]
        )
        validity = model.validity(geometry, albedo=1e-6, sigma_deg=sigma_deg)
        assert not validity.mask.any()  # a degree less, it is already far off the integral
        assert "negative" in validity.reason
        assert "off the integral" in validity.reason
        assert list(model.brdf(geometry, albedo=1e-6, sigma_deg=sigma_deg) >= 0) == [True, False]
    grazing = Geometry.from_degrees(theta_i=90, theta_r=[89, 90])
    assert not model.validity(grazing, albedo=0.5, sigma_deg=30).mask.any()
    assert model.validity(grazing, albedo=0.5, sigma_deg=0).mask.all()


def test_limits_of_the_qualitative_form() -> None:
    # errata: sigma 30 degrees, 75/60 opposite sides: 0.773 for an integral of 0.355
    model = MODELS["oren_nayar_qualitative"]
    geometry = Geometry.from_degrees(theta_i=75, theta_r=[-60, 0, 60])
    validity = model.validity(geometry, albedo=0.5, sigma_deg=30)
    assert list(validity.mask) == [False, True, True]
    assert "forward" in validity.reason
    assert model.validity(geometry, albedo=0.5, sigma_deg=5).mask.all()
