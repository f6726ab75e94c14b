"""Error of the printed forms: against the integral itself, and as the errata state it."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.models import MODELS
from analysis.models.rough.form_error import form_error
from analysis.models.rough.form_error_table import ERROR
from instrument.geometry import FloatArray, Geometry
from tests.support.models.geometries import special_directions

FORMS = ("lambert", "oren_nayar_qualitative", "oren_nayar")


def by_integration(name: str, geometry: Geometry, albedo: float, sigma_deg: float) -> FloatArray:
    rough = {"albedo": albedo, "sigma_deg": sigma_deg}
    own = {"albedo": albedo} if name == "lambert" else rough
    exact = MODELS["oren_nayar_exact"].brdf(geometry, **rough)
    return MODELS[name].brdf(geometry, **own) / exact - 1


@pytest.mark.parametrize("sigma_deg", [0.0, 0.4, 2.2, 3.0, 7.0, 23.0, 41.0, 60.0])
@pytest.mark.parametrize("albedo", [0.02, 1.0])
def test_form_error_is_that_against_the_integral(sigma_deg: float, albedo: float) -> None:
    geometry = special_directions(1500)
    for name in FORMS:
        found = form_error(name, geometry, albedo, sigma_deg)
        expected = by_integration(name, geometry, albedo, sigma_deg)
        assert np.all(np.abs(found - expected) <= ERROR * (1 + np.abs(expected)))


@pytest.mark.parametrize(
    ("name", "sigma_deg", "theta_i", "theta_r", "low", "high"),
    [
        ("oren_nayar", 30.0, 75.0, -60.0, 0.06, 0.08),
        ("oren_nayar", 20.0, 75.0, -75.0, 0.245, 0.395),
        ("oren_nayar", 30.0, 75.0, -75.0, 0.245, 0.395),
        ("oren_nayar", 10.0, 60.0, 60.0, 0.05, 0.07),
        ("oren_nayar_qualitative", 30.0, 75.0, -60.0, 1.1, 1.25),
    ],
)
def test_errors_that_the_errata_list(
    name: str, sigma_deg: float, theta_i: float, theta_r: float, low: float, high: float
) -> None:
    there = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r)
    assert low < abs(form_error(name, there, 0.0, sigma_deg)) < high


def within(name: str, sigma_deg: float, limit_deg: float, tolerance: float) -> bool:
    """True if the form keeps the tolerance at all angles up to a limit, by integration."""
    theta = np.arange(limit_deg + 1)
    i, r, dphi = np.meshgrid(theta, theta, np.arange(0, 181, 15), indexing="ij")
    upper = i >= r
    geometry = Geometry.from_degrees(theta_i=i[upper], theta_r=r[upper], dphi=dphi[upper])
    return all(
        np.all(np.abs(by_integration(name, geometry, albedo, sigma_deg)) <= tolerance)
        for albedo in (1e-9, 1.0)  # the error lies between these two for all albedos
    )


@pytest.mark.parametrize(
    ("name", "sigma_deg", "tolerance", "limit_deg"),
    [
        ("lambert", 5, 0.05, 66),
        ("lambert", 20, 0.20, 33),
        ("oren_nayar_qualitative", 10, 0.05, 51),
        ("oren_nayar_qualitative", 45, 0.20, 25),
        ("oren_nayar", 5, 0.01, 28),
        ("oren_nayar", 30, 0.05, 25),
        ("oren_nayar", 60, 0.20, 53),
    ],
)
def test_limit_angles_of_the_docstring(
    name: str, sigma_deg: float, tolerance: float, limit_deg: float
) -> None:
    assert within(name, sigma_deg, limit_deg, tolerance)
    assert not within(name, sigma_deg, limit_deg + 1, tolerance)


def test_error_is_infinite_beyond_the_table() -> None:
    geometry = Geometry.from_degrees(theta_i=[10.0, 85.0, 85.1, 90.0], theta_r=[[10.0], [20.0]])
    off = form_error("oren_nayar", geometry, 0.5, 1.0)
    assert off.shape == (2, 4)
    assert np.array_equal(np.isinf(off), [[False, False, True, True]] * 2)
    assert not np.any(np.abs(off[:, 0]) > 0.2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("wolff", 0.5, 10.0), "form = 'wolff'; allowed: lambert, oren_nayar_qualitative, oren_"),
        (("lambert", 1.5, 10.0), "albedo = 1.5; allowed: 0 to 1"),
        (("oren_nayar", 0.5, 61.0), "sigma_deg = 61 degrees; allowed: 0 to 60 degrees"),
    ],
)
def test_arguments_outside_the_table_are_errors(
    arguments: tuple[str, float, float], message: str
) -> None:
    name, albedo, sigma_deg = arguments
    with pytest.raises(ValueError, match=message):
        form_error(name, Geometry.from_degrees(theta_i=1, theta_r=1), albedo, sigma_deg)
