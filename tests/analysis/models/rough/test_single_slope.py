"""The isotropic single-slope surface (29) against the printed (28), closed forms and its limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad_vec

from analysis.models.rough.single_slope import isotropic_single_slope
from analysis.models.rough.v_cavity import (
    Directions,
    critical_angle,
    unidirectional_single_slope,
)
from tests.support.models.v_cavity_reference import GEOMETRIES, half_circle, printed_mean


def test_the_isotropic_surface_is_the_mean_of_grooves_of_all_azimuths() -> None:
    random = np.random.default_rng(4)
    for theta_i, theta_r, dphi in np.radians(GEOMETRIES):
        theta_a = random.uniform(0.01, 1.55, 12)
        direct, twice = isotropic_single_slope(theta_i, theta_r, dphi, theta_a, 64)
        expected = np.array([printed_mean(theta_i, theta_r, dphi, x) for x in theta_a])
        np.testing.assert_allclose(direct, expected[:, 0], rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(twice, expected[:, 1], rtol=1e-7, atol=1e-9)


def test_the_isotropic_surface_against_adaptive_quadrature() -> None:
    for theta_i, theta_r, dphi, theta_a in np.radians([(75, 60, 120, 50), (80, 40, 0, 30)]):
        towards = Directions(*(np.array(v) for v in (theta_i, 0.0, theta_r, dphi)))
        mean, _ = quad_vec(
            lambda phi, t=towards, a=theta_a: np.array(
                unidirectional_single_slope(t, np.array(a), np.array(phi))
            ),
            0,
            np.pi,
            points=half_circle(theta_i, theta_r, dphi, theta_a) % np.pi,
            epsrel=1e-10,
        )
        got = isotropic_single_slope(theta_i, theta_r, dphi, theta_a, 40)
        np.testing.assert_allclose(got, mean / np.pi, rtol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("grazing_deg", [90.0, 90 - 1e-6, 89.9])
def test_a_grazing_direction_gives_the_mean_of_grooves(slow: bool, grazing_deg: float) -> None:
    random = np.random.default_rng(10)
    for _ in range(1000 if slow else 60):
        grazing, other, theta_a = np.radians([grazing_deg, *random.uniform(0.5, 89, 2)])
        dphi = np.radians(random.choice([0.0, 90.0, 180.0, random.uniform(0, 360)]))
        angles = (grazing, other) if random.random() < 0.5 else (other, grazing)
        expected = printed_mean(*angles, dphi, theta_a)
        got = np.array(isotropic_single_slope(*angles, dphi, theta_a, 100)).ravel()
        np.testing.assert_allclose(got, expected, rtol=0, atol=2e-7 * expected.sum())


@pytest.mark.parametrize("nodes", [6, 10, 36])
def test_the_value_at_90_degrees_is_the_limit(nodes: int) -> None:
    random = np.random.default_rng(11)
    theta, theta_a = np.radians(random.uniform(0, 89, (2, 20000)))
    dphi = random.uniform(0, 2 * np.pi, 20000)
    dphi[::5], dphi[1::5], dphi[2::5] = 0, np.pi, np.pi / 2
    right = np.full(theta.size, np.pi / 2)
    for swap in (False, True):
        value, limit = (
            np.array(isotropic_single_slope(*pair[:: -1 if swap else 1], dphi, theta_a, nodes))
            for pair in ((right, theta), (right - 1e-6 * np.pi / 180, theta))
        )
        assert np.all(np.abs(value - limit) <= 1e-6 * value.sum(axis=0))
    assert np.any(value[1] > 0.1)


def printed_in_plane(theta_i: float, theta_r: float, theta_a: float, *, same: bool) -> float:
    """(40) and (41), over rho / pi E0 cos(theta_i)."""
    alpha, beta = max(theta_i, theta_r), min(theta_i, theta_r)
    ca, cb = (float(critical_angle(np.array(x), np.array(theta_a))) for x in (alpha, beta))
    t, a, b = math.tan(theta_a), math.tan(alpha), math.tan(beta)
    square = t * t * a * b / 2 * (1 - (2 * ca + math.sin(2 * ca)) / math.pi)
    if same:
        return math.cos(theta_a) * (1 + 2 * t * b * math.sin(ca) / math.pi + square)
    cut = 2 * t * b * (math.sin(cb) - math.sin(ca)) / math.pi
    return math.cos(theta_a) * (1 - 2 * cb / math.pi + cut - square)


def printed_perpendicular(theta_i: float, theta_r: float, theta_a: float) -> float:
    """(42) and (43), over rho / pi E0 cos(theta_i)."""
    critical = sum(
        float(critical_angle(np.array(x), np.array(theta_a))) for x in (theta_i, theta_r)
    )
    if critical <= math.pi / 2:
        return math.cos(theta_a)
    t, i, r = math.tan(theta_a), math.tan(theta_i), math.tan(theta_r)
    roots = math.sqrt(r * r * t * t - 1) + math.sqrt(i * i * t * t - 1) - t * math.hypot(i, r)
    return math.cos(theta_a) * (1.5 - critical / math.pi + roots / math.pi)


@given(*(st.floats(0.01, 1.5) for _ in range(3)))
def test_the_direct_part_is_the_papers_closed_form_in_its_two_planes(
    theta_i: float, theta_r: float, theta_a: float
) -> None:
    for dphi, expected in (
        (0.0, printed_in_plane(theta_i, theta_r, theta_a, same=True)),
        (np.pi, printed_in_plane(theta_i, theta_r, theta_a, same=False)),
        (np.pi / 2, printed_perpendicular(theta_i, theta_r, theta_a)),
    ):
        arrays = (np.array(x) for x in (theta_i, theta_r, dphi, theta_a))
        direct = isotropic_single_slope(*arrays).direct
        assert direct == pytest.approx(expected, rel=1e-11, abs=1e-12)


def test_the_isotropic_surface_is_reciprocal() -> None:
    random = np.random.default_rng(6)
    theta_i, theta_r, theta_a = random.uniform(0.01, 1.48, (3, 500))
    dphi = random.uniform(0, 2 * np.pi, 500)
    dphi[::5], theta_r[::7] = np.pi, theta_i[::7]
    one = isotropic_single_slope(theta_i, theta_r, dphi, theta_a, 24)
    two = isotropic_single_slope(theta_r, theta_i, dphi, theta_a, 24)
    np.testing.assert_allclose(one.direct, two.direct, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(one.twice, two.twice, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("which", ["theta_i", "theta_r", "theta_a"])
@pytest.mark.parametrize("wrong", [-0.1, 1.6, math.nan])
def test_angles_outside_the_hemisphere_are_refused(which: str, wrong: float) -> None:
    angles = {"theta_i": np.array(0.5), "theta_r": np.array(0.6), "theta_a": np.array(0.7)}
    words = f"{which} = {wrong:.12g} radians; allowed: 0 to pi/2"
    with pytest.raises(ValueError, match=words):
        isotropic_single_slope(**(angles | {which: np.array(wrong)}), dphi=np.array(1.0))


def test_finite_at_the_ends_of_the_domain() -> None:
    random = np.random.default_rng(8)
    ends = np.array([0.0, 1e-300, 1e-9, 0.7, np.pi / 2 - 1e-9, np.pi / 2])
    theta_i, theta_r, theta_a = random.choice(ends, (3, 3000))
    dphi = random.choice([0.0, np.pi / 2, np.pi, 2.0], 3000)
    with np.errstate(all="raise", under="ignore"):
        found = np.array(isotropic_single_slope(theta_i, theta_r, dphi, theta_a))
    assert np.all(np.isfinite(found) & (found >= 0))


def test_too_few_nodes_are_refused() -> None:
    with pytest.raises(ValueError, match="nodes = 3; allowed: 4 or more"):
        isotropic_single_slope(*(np.array(0.5) for _ in range(4)), nodes=3)
