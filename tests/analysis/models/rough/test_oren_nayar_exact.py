"""The exact Oren-Nayar model against adaptive quadrature of the printed facets, and its limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad_vec

from analysis.models import MODELS
from analysis.models.rough.oren_nayar_exact import (
    COARSE,
    FINE,
    RULE,
    Rule,
    clear_profile_cache,
    oren_nayar_exact_brdf,
    slope_kinks,
)
from instrument.geometry import FloatArray, Geometry
from tests.support.models.derivatives import central_difference
from tests.support.models.geometries import (
    exchanged,
    special_directions,
)
from tests.support.models.v_cavity_reference import GEOMETRIES, printed_mean

EXACT = MODELS["oren_nayar_exact"]

SIGMAS_DEG = np.array([0.5, 1.0, 3.0, 7.0, 15.0, 30.0, 45.0, 60.0])


def reference(theta_i: float, theta_r: float, dphi: float) -> FloatArray:
    """(31), adaptively over the slope, of the printed facets: (direct, twice) by sigma."""
    sigma = np.radians(SIGMAS_DEG)
    larger, smaller = np.array([max(theta_i, theta_r)]), np.array([min(theta_i, theta_r)])

    def integrand(theta_a: float) -> FloatArray:
        density = np.exp(-0.5 * (theta_a / sigma) ** 2) * math.sin(theta_a)
        parts = printed_mean(theta_i, theta_r, dphi, theta_a)
        return np.stack([density, parts[0] * density, parts[1] * density])

    points = np.append(slope_kinks(larger, smaller, np.array([dphi])), np.radians([1, 3, 10]))
    inside = np.unique(points[(points > 1e-6) & (points < 1.5707)])
    options = {"points": inside, "epsrel": 1e-8, "epsabs": 1e-11, "norm": "max", "limit": 400}
    total, _ = quad_vec(integrand, 1e-9, np.pi / 2 - 1e-9, **options)
    return np.asarray(total[1:] / total[0])


@pytest.mark.slow
@pytest.mark.parametrize("angles", GEOMETRIES)
def test_exact_to_1e_6_from_smooth_to_very_rough(
    angles: tuple[float, float, float], slow: bool
) -> None:
    if not (slow or angles in GEOMETRIES[::2]):
        pytest.skip("with --slow")
    theta_i, theta_r, dphi = angles
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    direct, twice = reference(*np.radians(angles))
    for n, sigma in enumerate(SIGMAS_DEG):
        for albedo in (0.1, 1.0):
            expected = albedo / np.pi * (direct[n] + albedo * twice[n])
            got = EXACT.brdf(geometry, albedo=albedo, sigma_deg=sigma)
            assert got == pytest.approx(expected, rel=1e-6)


def nearly_special(count: int) -> Geometry:
    """Near 85 degrees, and 1e-10 to 10 degrees from equal angles, the plane, or square to it."""
    random = np.random.default_rng(8)

    def small() -> FloatArray:
        return np.asarray(10 ** random.uniform(-10, 1, count))

    theta_i = 85 - small()
    theta_r = np.where(random.random(count) < 0.7, np.abs(theta_i - small()), small())
    dphi = np.abs(random.choice([0, 90, 180], count) - small())
    return Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [0.5, 5.0, 20.0, 60.0])
def test_the_rules_keep_their_stated_accuracy(sigma: float, slow: bool) -> None:
    count = 400 if slow else 150
    for geometry in (special_directions(count), nearly_special(count)):
        best = oren_nayar_exact_brdf(geometry, 1.0, sigma, Rule(26, 18, 90))
        for rule, accuracy in ((COARSE, 1e-4), (RULE, 1e-6), (FINE, 1e-8)):
            got = oren_nayar_exact_brdf(geometry, 1.0, sigma, rule)
            np.testing.assert_allclose(got, best, rtol=accuracy)
    clear_profile_cache()


@pytest.mark.slow
@pytest.mark.parametrize("theta", [86.0, 88.0, 89.0, 89.9, 90.0])
def test_near_grazing_the_rules_are_worse_as_stated(theta: float, slow: bool) -> None:
    random, n = np.random.default_rng(12), 150 if slow else 50
    other = np.where(random.random(n) < 0.5, random.uniform(0, 1, n), random.uniform(0.97, 1, n))
    geometry = Geometry.from_degrees(
        theta_i=theta,
        theta_r=np.minimum(theta, 89.9) * other,
        dphi=random.choice([0.0, 30.0, 90.0, 150.0, 170.0, 180.0], n),
    )
    for sigma in (1.0, 10.0, 60.0):
        best = oren_nayar_exact_brdf(geometry, 1.0, sigma, Rule(20, 14, 300))
        for rule, accuracy in ((COARSE, 4e-4), (RULE, 1e-5), (FINE, 2e-8)):
            got = oren_nayar_exact_brdf(geometry, 1.0, sigma, rule)
            np.testing.assert_allclose(got, best, rtol=accuracy)
    clear_profile_cache()


@settings(max_examples=200)
@given(
    theta=st.floats(0, 89),
    dphi=st.one_of(st.floats(0, 360), st.sampled_from([0.0, 90.0, 180.0])),
    sigma_deg=st.floats(0.5, 60),
    albedo=st.floats(0.01, 1),
    lamp=st.booleans(),
)
def test_the_value_at_90_degrees_is_the_limit(
    theta: float, dphi: float, sigma_deg: float, albedo: float, lamp: bool
) -> None:
    grazing, other = np.array([90.0, 90 - 1e-6]), np.full(2, theta)
    i, r = (grazing, other) if lamp else (other, grazing)
    geometry = Geometry.from_degrees(theta_i=i, theta_r=r, dphi=dphi)
    at_90, limit = EXACT.brdf(geometry, albedo=albedo, sigma_deg=sigma_deg)
    assert at_90 == pytest.approx(limit, rel=1e-6)


def test_errors_of_the_printed_forms_are_those_of_the_errata() -> None:
    # errata of the papers: sigma 30 degrees, 75/60 on opposite sides and on the same side
    opposite = Geometry.from_degrees(theta_i=75, theta_r=-60)
    same = Geometry.from_degrees(theta_i=75, theta_r=60)
    rough = {"albedo": 1e-9, "sigma_deg": 30.0}
    direct = EXACT.brdf(opposite, **rough) * np.pi / 1e-9
    assert direct == pytest.approx(0.355, abs=6e-4)
    functional = MODELS["oren_nayar"].brdf(opposite, **rough) * np.pi / 1e-9
    assert abs(functional / direct - 1) == pytest.approx(0.07, abs=5e-3)
    qualitative = MODELS["oren_nayar_qualitative"].brdf(opposite, **rough) * np.pi / 1e-9
    assert qualitative == pytest.approx(0.773, abs=6e-4)
    for name, value in (("oren_nayar_exact", 0.0336), ("oren_nayar", 0.064)):
        once = MODELS[name].brdf(same, **rough) * 1e9
        twice = MODELS[name].brdf(same, albedo=1.0, sigma_deg=30.0) - once
        assert twice * np.pi == pytest.approx(value, abs=6e-4)


@given(
    theta_i=st.floats(0, 90),
    theta_r=st.floats(0, 90),
    dphi=st.floats(0, 360),
    sigma_deg=st.floats(0, 60),
)
def test_reciprocal_finite_and_not_negative(
    theta_i: float, theta_r: float, dphi: float, sigma_deg: float
) -> None:
    there = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    back = exchanged(there, same_dphi=True)
    value = EXACT.brdf(there, albedo=0.8, sigma_deg=sigma_deg)
    assert np.isfinite(value)
    assert value >= 0
    assert value == pytest.approx(EXACT.brdf(back, albedo=0.8, sigma_deg=sigma_deg), rel=1e-12)


def test_finite_at_every_corner_of_the_closed_domain() -> None:
    grid = np.meshgrid([0, 1e-9, 45, 90 - 1e-9, 90], [0, 1e-9, 45, 90], [0, 90, 180, 180 - 1e-9])
    geometry = Geometry.from_degrees(theta_i=grid[0], theta_r=grid[1], dphi=grid[2])
    for sigma in (0.0, 1e-300, 1e-7, 0.01, 0.5, 60.0):
        for albedo in (0.0, 1.0):
            value = EXACT.brdf(geometry, albedo=albedo, sigma_deg=sigma)
            assert np.all(np.isfinite(value) & (value >= 0))
            for slope in EXACT.gradient(geometry, albedo=albedo, sigma_deg=sigma).values():
                assert np.all(np.isfinite(slope))
    both = (geometry.theta_i_deg == 90) & (geometry.theta_r_deg == 90)
    valid = EXACT.validity(geometry, albedo=1.0, sigma_deg=60.0)
    assert np.array_equal(valid.mask, ~both)
    assert "graze" in valid.reason


@pytest.mark.parametrize("sigma_deg", [0.0, 1e-9, 1e-3])
def test_a_smooth_surface_is_lambertian(sigma_deg: float) -> None:
    geometry = special_directions(200, 80)
    got = EXACT.brdf(geometry, albedo=0.7, sigma_deg=sigma_deg)
    np.testing.assert_allclose(got, 0.7 / np.pi, rtol=1e-7)


@pytest.mark.parametrize("sigma_deg", [1.0, 20.0, 60.0])
def test_no_more_light_leaves_than_arrives(sigma_deg: float) -> None:
    """At normal incidence the energy of one bounce is known: all facets are lit, and the part
    1 - cos(theta_a) of what one sends out meets its neighbour (the form factor of two strips that
    share an edge).
    """
    x, w = np.polynomial.legendre.leggauss(32)
    theta_r, weight = 45 * (x + 1), np.pi / 4 * w
    dphi = np.arange(0.0, 180, 10) + 5
    theta_i = np.array([0.0, 30.0, 60.0, 80.0, 89.0])
    geometry = Geometry.from_degrees(
        theta_i=theta_i[:, None, None], theta_r=theta_r[:, None], dphi=dphi
    )
    solid = weight * np.sin(2 * np.radians(theta_r))

    def reflectance(albedo: float) -> FloatArray:
        value = EXACT.brdf(geometry, albedo=albedo, sigma_deg=sigma_deg).mean(axis=-1)
        return np.pi * value @ solid

    assert np.all(reflectance(1.0) <= 1 + 1e-4)
    theta_a = np.linspace(0, np.pi / 2, 20001)
    density = np.exp(-0.5 * (theta_a / np.radians(sigma_deg)) ** 2) * np.sin(theta_a)
    once = np.average(np.cos(theta_a), weights=density)
    assert reflectance(1e-9)[0] == pytest.approx(1e-9 * once, rel=1e-5)
    assert once < reflectance(1.0)[0] < 1


def fourth_difference(theta_i: float, theta_r: FloatArray, dphi: float) -> float:
    """The largest: proportional to the fourth power of the step where the function is smooth."""
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    values = EXACT.brdf(geometry, albedo=1.0, sigma_deg=20.0)
    return float(np.max(np.abs(np.diff(values, 4))))


def test_smooth_in_the_view_angle_out_of_the_plane() -> None:
    theta_r = np.arange(1, 84, 0.25)
    for dphi in (30, 90, 150):
        assert fourth_difference(60, theta_r, dphi) < 5e-8
    # In the plane the surface itself has a cusp where the camera meets the lamp, and only there.
    assert fourth_difference(60, theta_r, 0) > 1e-4
    assert fourth_difference(60, theta_r[theta_r < 60], 0) < 5e-8
    assert fourth_difference(60, theta_r[theta_r > 60], 0) < 5e-8


def test_smooth_in_sigma() -> None:
    one = Geometry.from_degrees(theta_i=75, theta_r=60, dphi=150)
    sigma = np.arange(0.5, 60, 0.25)
    values = np.array([float(EXACT.brdf(one, albedo=1.0, sigma_deg=s)) for s in sigma])
    assert np.max(np.abs(np.diff(values, 4))) < 2e-6


@pytest.mark.parametrize("sigma_deg", [0.5, 2.0, 20.0, 59.0])
def test_the_gradient_is_that_of_central_differences(sigma_deg: float) -> None:
    geometry, values = special_directions(100), {"albedo": 0.6, "sigma_deg": sigma_deg}
    gradient = EXACT.gradient(geometry, **values)
    for name, step in (("albedo", 1e-3), ("sigma_deg", 1e-3 * sigma_deg)):
        expected = central_difference(
            lambda x, name=name: EXACT.brdf(geometry, **{**values, name: x}), values[name], step
        )
        scale = np.max(np.abs(gradient[name]))
        np.testing.assert_allclose(gradient[name], expected, rtol=1e-5, atol=1e-6 * scale + 1e-7)


@settings(max_examples=20)
@given(shape=st.sampled_from([(), (1,), (0,), (3,), (2, 3), (1500,)]))
def test_shapes_are_preserved(shape: tuple[int, ...]) -> None:
    geometry = Geometry.from_degrees(theta_i=np.full(shape, 40.0), theta_r=50.0, dphi=100.0)
    one = Geometry.from_degrees(theta_i=40.0, theta_r=50.0, dphi=100.0)
    value = EXACT.brdf(geometry, albedo=0.5, sigma_deg=25.0)
    assert value.shape == shape
    assert value.dtype == np.float64
    np.testing.assert_allclose(value, EXACT.brdf(one, albedo=0.5, sigma_deg=25.0), rtol=1e-13)
