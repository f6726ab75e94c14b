"""Validity of the printed forms of Oren and Nayar."""

from __future__ import annotations

from analysis.models import MODELS
from instrument.geometry import Geometry


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
