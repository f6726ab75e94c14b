"""The table of where the printed forms fail: against the integral itself, and as the errata say."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.models import MODELS
from analysis.models.rough import form_error as module
from analysis.models.rough.form_error import (
    ERROR,
    LIMIT_DEG,
    computed,
    departure,
    fails,
    grid,
    integral,
)
from instrument.geometry import FloatArray, Geometry

FORMS = ("lambert", "oren_nayar_qualitative", "oren_nayar")


def scattered(count: int) -> Geometry:
    """Geometries all over the table's domain; some in the plane, some with equal angles."""
    random = np.random.default_rng(7)
    theta_i, theta_r = random.uniform(0, LIMIT_DEG, (2, count))
    dphi = random.uniform(0, 360, count)
    dphi[::5], dphi[1::5] = 0, 180
    theta_r[::3] = theta_i[::3]
    theta_i[1::4] = random.uniform(75, LIMIT_DEG, theta_i[1::4].size)
    return Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)


def by_integration(name: str, geometry: Geometry, albedo: float, sigma_deg: float) -> FloatArray:
    rough = {"albedo": albedo, "sigma_deg": sigma_deg}
    own = {"albedo": albedo} if name == "lambert" else rough
    exact = MODELS["oren_nayar_exact"].brdf(geometry, **rough)
    return MODELS[name].brdf(geometry, **own) / exact - 1


def test_the_kept_table_is_what_the_integral_gives() -> None:
    with np.load(module.FILE) as kept:
        np.testing.assert_allclose(kept["direct_and_twice"], computed(), rtol=1e-6, atol=1e-7)
        for name, nodes in grid().items():
            np.testing.assert_array_equal(kept[name], nodes)


@pytest.mark.parametrize("sigma_deg", [0.0, 0.4, 2.2, 3.0, 7.0, 23.0, 41.0, 60.0])
@pytest.mark.parametrize("albedo", [0.02, 1.0])
def test_between_its_nodes_too(sigma_deg: float, albedo: float) -> None:
    geometry = scattered(1500)
    exact = MODELS["oren_nayar_exact"].brdf(geometry, albedo=albedo, sigma_deg=sigma_deg)
    off = np.abs(integral(geometry, albedo, sigma_deg) / exact - 1)
    assert off.max() <= ERROR
    assert np.quantile(off, 0.99) <= 1e-3
    for name in FORMS:
        found = departure(name, geometry, albedo, sigma_deg)
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
def test_the_failures_that_the_errata_list(
    name: str, sigma_deg: float, theta_i: float, theta_r: float, low: float, high: float
) -> None:
    there = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r)
    assert low < abs(departure(name, there, 0.0, sigma_deg)) < high


def within(name: str, sigma_deg: float, limit_deg: float, tolerance: float) -> bool:
    """Whether the form keeps the tolerance at all angles up to a limit, by integration."""
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
def test_the_angles_that_the_docstring_names(
    name: str, sigma_deg: float, tolerance: float, limit_deg: float
) -> None:
    assert within(name, sigma_deg, limit_deg, tolerance)
    assert not within(name, sigma_deg, limit_deg + 1, tolerance)


def test_what_is_not_known_fails() -> None:
    geometry = Geometry.from_degrees(theta_i=[10.0, 85.0, 85.1, 90.0], theta_r=[[10.0], [20.0]])
    off = departure("oren_nayar", geometry, 0.5, 1.0)
    assert off.shape == (2, 4)
    assert np.array_equal(np.isinf(off), [[False, False, True, True]] * 2)
    assert fails("oren_nayar", geometry, 0.5, 1.0, 0.2)[:, 2:].all()
    assert not fails("oren_nayar", geometry, 0.5, 1.0, 0.2)[:, 0].any()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("wolff", 0.5, 10.0), "form = 'wolff'; allowed: lambert, oren_nayar_qualitative, oren_"),
        (("lambert", 1.5, 10.0), "albedo = 1.5; allowed: 0 to 1"),
        (("oren_nayar", 0.5, 61.0), "sigma_deg = 61 degrees; allowed: 0 to 60 degrees"),
    ],
)
def test_what_the_table_does_not_have(arguments: tuple[str, float, float], message: str) -> None:
    name, albedo, sigma_deg = arguments
    with pytest.raises(ValueError, match=message):
        departure(name, Geometry.from_degrees(theta_i=1, theta_r=1), albedo, sigma_deg)
