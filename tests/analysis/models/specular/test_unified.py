"""The unified framework: its three components, and fixed lamp against fixed camera."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.models import MODELS
from analysis.models.specular.unified import (
    lobe_shape,
    mirror_angle,
    moving_sensor,
    moving_source,
    spike_shape,
)
from instrument.geometry import FloatArray, Geometry
from tests.support.models.derivatives import central_difference
from tests.support.models.geometries import (
    exchanged,
    unit_vectors,
)

MODEL = MODELS["unified"]

ANGLE = st.floats(0.0, 88.0)

AZIMUTH = st.floats(0.0, 360.0)

VALUES = {"diffuse": 0.4, "lobe": 0.3, "sigma_deg": 12.0, "spike": 0.2, "spike_width_deg": 1.5}


def printed(i: float, r: float, p: float, v: dict[str, float]) -> float:
    """The formula by vectors; angles in radians."""
    lamp, camera = unit_vectors(i, r, p)
    mirror = lamp * [-1, -1, 1]
    half = lamp + camera
    alpha = math.atan2(math.hypot(half[0], half[1]), half[2])
    delta = math.atan2(float(np.linalg.norm(np.cross(mirror, camera))), float(mirror @ camera))
    s, w = math.radians(v["sigma_deg"]), math.radians(v["spike_width_deg"])
    cc = math.cos(i) * math.cos(r)
    lobe = v["lobe"] * math.exp(-(alpha**2) / (2 * s**2)) / cc
    spike = v["spike"] * math.exp(-(delta**2) / (2 * w**2)) / (2 * math.pi * w**2 * math.sqrt(cc))
    return v["diffuse"] / math.pi + lobe + spike


@given(theta_i=ANGLE, off=st.floats(-5.0, 5.0), side=st.floats(-5.0, 5.0))
def test_the_printed_formula_near_the_mirror_direction(
    theta_i: float, off: float, side: float
) -> None:
    theta_r = min(max(theta_i + off, 0.0), 88.0)
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=180 + side)
    expected = printed(*map(math.radians, (theta_i, theta_r, 180 + side)), VALUES)
    assert MODEL.brdf(geometry, **VALUES) == pytest.approx(expected, rel=1e-10)


@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH)
def test_the_printed_formula_anywhere_reciprocal_and_not_negative(
    theta_i: float, theta_r: float, dphi: float
) -> None:
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    found = MODEL.brdf(geometry, **VALUES)
    assert found >= 0
    expected = printed(*map(math.radians, (theta_i, theta_r, dphi)), VALUES)
    assert found == pytest.approx(expected, rel=1e-9)
    assert MODEL.brdf(exchanged(geometry, same_dphi=True), **VALUES) == pytest.approx(
        found, rel=1e-11
    )


def scan(theta_i: float | FloatArray, theta_r: float | FloatArray) -> Geometry:
    return Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=180.0)


def test_with_a_fixed_lamp_it_is_equation_61() -> None:
    geometry = scan(40.0, np.linspace(30, 50, 41))
    cos_i = math.cos(math.radians(40))
    v = VALUES
    found = MODEL.brdf(geometry, **v) * cos_i
    C_dl = v["diffuse"] / math.pi * cos_i
    expected = moving_sensor(
        geometry, C_dl, v["lobe"], v["sigma_deg"], v["spike"], v["spike_width_deg"]
    )
    # The spike's cosines, made symmetric, are off by their change over its width.
    spike = v["spike"] * spike_shape(geometry, v["spike_width_deg"])
    bound = spike * np.abs(np.sqrt(cos_i / np.cos(geometry.theta_r)) - 1)
    assert np.all(np.abs(found - expected) <= bound + 1e-12 * expected)
    assert np.all(bound < 0.012 * np.max(spike))


def test_with_a_fixed_camera_it_is_equation_62() -> None:
    geometry = scan(np.linspace(30, 50, 41), 40.0)
    cos_r = math.cos(math.radians(40))
    v = {**VALUES, "spike": 0.0}
    expected = moving_source(
        geometry, v["diffuse"] / math.pi, v["lobe"] / cos_r, v["sigma_deg"], 0.0, 1.5
    )
    found = MODEL.brdf(geometry, **v) * np.cos(geometry.theta_i)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_the_peak_is_off_specular_for_a_moving_sensor_only() -> None:
    angles = np.linspace(30.0, 80.0, 1001)
    sensor = moving_sensor(scan(50.0, angles), 0.0, 1.0, 15.0, 0.0, 1.0)
    source = moving_source(scan(angles, 50.0), 0.0, 1.0, 15.0, 0.0, 1.0)
    assert angles[np.argmax(sensor)] > 55
    assert angles[np.argmax(source)] == pytest.approx(50, abs=0.05)
    # symmetric about the mirror direction, as the paper states for (62)
    left, right = (moving_source(scan(50.0 + d, 50.0), 0.3, 1.0, 15.0, 0.5, 2.0) for d in (-4, 4))
    K_dl_part = 0.3 * (math.cos(math.radians(46)) - math.cos(math.radians(54)))
    assert left - right == pytest.approx(K_dl_part, rel=1e-9)


@pytest.mark.parametrize("width", [0.05, 1.0, 10.0])
@pytest.mark.parametrize("theta_i", [0.0, 35.0])
def test_the_spike_integrates_to_one(width: float, theta_i: float) -> None:
    # over the whole sphere of directions about the mirror: 1 - w^2/3
    t, w = np.polynomial.legendre.leggauss(200)
    delta = np.radians(8 * min(width, 6.0)) / 2 * (t + 1)
    weight = np.radians(8 * min(width, 6.0)) / 2 * w
    geometry = Geometry.from_degrees(theta_i=0.0, theta_r=np.degrees(delta))
    shape = spike_shape(geometry, width)
    total = float(2 * np.pi * (weight * np.sin(delta)) @ shape)
    assert total == pytest.approx(1 - math.radians(width) ** 2 / 3, rel=3e-4)
    assert mirror_angle(scan(theta_i, theta_i)) < 1e-15


def test_the_mirror_angle_keeps_its_digits() -> None:
    off = np.array([1e-2, 1e-5, 1e-8])
    geometry = scan(45.0, 45.0 + off)
    exact = np.radians(geometry.theta_r_deg - 45.0)
    np.testing.assert_allclose(mirror_angle(geometry), exact, rtol=1e-6)
    assert mirror_angle(Geometry.from_degrees(theta_i=90, theta_r=90)) == pytest.approx(math.pi)


GRID = Geometry.from_degrees(
    theta_i=np.array([0.0, 20.0, 60.0, 85.0])[:, None, None],
    theta_r=np.array([0.0, 19.0, 60.5, 86.0])[:, None],
    dphi=[0.0, 90.0, 178.0, 180.0],
)


@pytest.mark.parametrize("part", [0.01, 0.3, 0.9])
def test_gradient_is_that_of_central_differences(part: float) -> None:
    values = {p.name: p.low + part * (p.high - p.low) for p in MODEL.parameters}
    found = MODEL.gradient(GRID, **values)
    level = MODEL.brdf(GRID, **values)
    for name, value in values.items():
        h = 1e-4 * value
        expected = central_difference(
            lambda x, name=name: MODEL.brdf(GRID, **{**values, name: x}), value, h
        )
        assert found[name].shape == GRID.shape
        assert np.all(
            np.abs(found[name] - expected) <= 1e-7 * np.abs(expected) + 1e-9 * level / value
        )


def test_each_component_by_itself() -> None:
    zero = {**VALUES, "diffuse": 0.0, "lobe": 0.0, "spike": 0.0}
    diffuse = MODEL.brdf(GRID, **{**zero, "diffuse": 0.7})
    np.testing.assert_allclose(diffuse, MODELS["lambert"].brdf(GRID, albedo=0.7), rtol=1e-15)
    cc = np.cos(GRID.theta_i) * np.cos(GRID.theta_r)
    np.testing.assert_allclose(
        MODEL.brdf(GRID, **{**zero, "lobe": 0.7}), 0.7 * lobe_shape(GRID, 12.0) / cc, rtol=1e-14
    )
    assert np.all(MODEL.brdf(GRID, **zero) == 0)


def test_the_closed_domain_and_both_sides_of_validity() -> None:
    ends = np.array([0.0, 45.0, 89.9, 90.0])
    geometry = Geometry.from_degrees(
        theta_i=ends[:, None, None], theta_r=ends[:, None], dphi=[0.0, 90.0, 180.0]
    )
    for corner in ("low", "default", "high"):
        values = {p.name: getattr(p, corner) for p in MODEL.parameters}
        with np.errstate(all="raise"):
            f = MODEL.brdf(geometry, **values)
            gradient = MODEL.gradient(geometry, **values)
        assert np.all(np.isfinite(f) & (f >= 0))
        assert f.dtype == np.float64
        assert all(np.all(np.isfinite(s)) for s in gradient.values())
    valid = MODEL.validity(geometry, **VALUES)
    grazes = (geometry.theta_i_deg == 90) | (geometry.theta_r_deg == 90)
    np.testing.assert_array_equal(valid.mask, ~grazes)
    assert "diverges" in valid.reason
    # as printed it grows as 1/cos
    near, nearer = (float(MODEL.brdf(scan(80.0, t), **VALUES)) for t in (89.9, 89.99))
    shapes = [float(lobe_shape(scan(80.0, t), 12.0)) for t in (89.9, 89.99)]
    assert (nearer - 0.4 / math.pi) / (near - 0.4 / math.pi) == pytest.approx(
        10 * shapes[1] / shapes[0], rel=1e-3
    )


@pytest.mark.parametrize("framework", [moving_sensor, moving_source])
def test_wrong_widths_are_named(framework: Callable[..., FloatArray]) -> None:
    for wrong in (-5.0, 0.0, math.nan):
        with pytest.raises(
            ValueError, match=f"^sigma_deg = {wrong:g} degrees; allowed: 0.01 to 60"
        ):
            framework(scan(10.0, 10.0), 1.0, 1.0, wrong, 1.0, 1.0)
        with pytest.raises(
            ValueError, match=f"^spike_width_deg = {wrong:g} degrees; allowed: 0.05"
        ):
            framework(scan(10.0, 10.0), 1.0, 1.0, 10.0, 1.0, wrong)


@pytest.mark.parametrize("framework", [moving_sensor, moving_source])
@pytest.mark.parametrize(
    ("sigma", "theta"), np.random.default_rng(61).uniform((-2, 0), (-0.3, 80), (8, 2)).tolist()
)
def test_narrow_lobes_are_gaussians_about_the_mirror(
    framework: Callable[..., FloatArray], sigma: float, theta: float
) -> None:
    """1991, figure 13 (a) and (b): σ of 0.01 and 0.1 degrees, narrower than a fit allows."""
    sigma = 10**sigma
    theta_r = theta + np.linspace(-10, 10, 81) * sigma
    theta_r = theta_r[theta_r > 0]
    at = Geometry.from_degrees(theta_i=theta, theta_r=theta_r, dphi=180.0)
    expected = np.exp(-0.5 * ((theta_r - theta) / 2 / sigma) ** 2)
    if framework is moving_sensor:
        expected /= np.cos(np.radians(theta_r))
    np.testing.assert_allclose(framework(at, 0.0, 1.0, sigma, 0.0, 1.0), expected, rtol=1e-8)
