"""V-cavities against rays and a Monte Carlo of photons, and their limits."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from analysis.models.rough.v_cavity import (
    Directions,
    attenuation,
    critical_angle,
    interreflection_factor,
    masked_width,
    shadowed_width,
    unidirectional_single_slope,
)
from instrument.geometry import FloatArray

UP = np.array(0.0)

# Rays in the cross-section of a cavity: x across the groove, z up. The facet with its normal
# towards +x rises from the groove at the origin towards -x, its neighbour towards +x.


def reaches(points: FloatArray, towards: FloatArray, theta_a: float, side: int) -> FloatArray:
    """True if light leaves points (..., 2) of the facet on that side (-1, 1) in `towards`."""
    normal = np.array([-side * math.sin(theta_a), math.cos(theta_a)])
    other = np.array([-side * math.cos(theta_a), math.sin(theta_a)])
    determinant = towards[..., 1] * other[0] - towards[..., 0] * other[1]
    determinant = np.where(determinant == 0, 1e-300, determinant)
    # points + s towards = t other: met at the part t of the neighbour, s ahead
    s = (points[..., 0] * other[1] - points[..., 1] * other[0]) / determinant
    t = (points[..., 0] * towards[..., 1] - points[..., 1] * towards[..., 0]) / determinant
    met = (s > 0) & (t >= 0) & (t <= 1)
    return (towards @ normal > 0) & ~met


def in_section(theta: float, azimuth: float) -> FloatArray:
    """Direction seen in the cross-section of a groove at that azimuth from it."""
    return np.array([math.sin(theta) * math.cos(azimuth), math.cos(theta)])


def random_cavities(count: int, seed: int) -> Iterator[tuple[float, ...]]:
    random = np.random.default_rng(seed)
    for _ in range(count):
        theta_i, theta_r, theta_a = np.radians(random.uniform(1, 89, 3))
        phi_r, phi_a = random.uniform(0, 2 * np.pi, 2)
        yield theta_i, theta_r, theta_a, phi_r, phi_a


def test_the_attenuation_is_the_part_that_rays_reach_from_lamp_and_camera() -> None:
    t = (np.arange(20000) + 0.5) / 20000
    for theta_i, theta_r, theta_a, phi_r, phi_a in random_cavities(400, 1):
        points = np.outer(t, [-math.cos(theta_a), math.sin(theta_a)])
        lit = reaches(points, in_section(theta_i, phi_a), theta_a, -1)
        seen = reaches(points, in_section(theta_r, phi_r - phi_a), theta_a, -1)
        towards = Directions(*(np.array(x) for x in (theta_i, 0.0, theta_r, phi_r)))
        factor = attenuation(towards, np.array(theta_a), np.array(phi_a))
        assert factor == pytest.approx(np.mean(lit & seen), abs=1e-4)


@pytest.mark.slow
def test_the_interreflection_factor_is_that_of_a_monte_carlo_exchange(slow: bool) -> None:
    """Photons leave the seen part of a facet by Lambert's law and count where the next is lit."""
    random = np.random.default_rng(2)
    n = 200_000 if slow else 50_000
    checked = 0
    for theta_i, theta_r, theta_a, phi_r, phi_a in random_cavities(60, 3):
        towards = Directions(*(np.array(x) for x in (theta_i, 0.0, theta_r, phi_r)))
        slope, azimuth = np.array(theta_a), np.array(phi_a)
        masked = masked_width(towards, slope, azimuth)
        shadowed = shadowed_width(towards, slope, azimuth)
        t = random.uniform(size=n)
        points = np.outer(t, [-math.cos(theta_a), math.sin(theta_a)])
        sine, turn = np.sqrt(random.uniform(size=n)), random.uniform(0, 2 * np.pi, n)
        along, out = sine * np.cos(turn), np.sqrt(1 - sine**2)
        leaves = np.stack(
            [
                out * math.sin(theta_a) - along * math.cos(theta_a),
                out * math.cos(theta_a) + along * math.sin(theta_a),
            ],
            axis=-1,
        )
        other = np.array([math.cos(theta_a), math.sin(theta_a)])
        determinant = leaves[:, 1] * other[0] - leaves[:, 0] * other[1]
        met = (points[:, 0] * leaves[:, 1] - points[:, 1] * leaves[:, 0]) / determinant
        hit = ~reaches(points, leaves, theta_a, -1)
        lit = reaches(np.outer(met, other), in_section(theta_i, phi_a), theta_a, 1)
        seen = reaches(points, in_section(theta_r, phi_r - phi_a), theta_a, -1)
        part = np.mean(hit & lit & seen)
        error = math.sqrt(part * (1 - part) / n) + 1e-5
        factor = interreflection_factor(masked, shadowed, slope)
        assert factor / np.pi == pytest.approx(part, abs=5 * error)
        checked += bool(0 < masked < 1 or 0 < shadowed < 1) and part > 0.01
    assert checked > 10


@pytest.mark.parametrize("lamp", [True, False])
def test_grooves_at_90_degrees_are_the_limit(lamp: bool) -> None:
    """(28) at 90 degrees is that at 89.999999: rays along the groove, cos(phi) = 0, have none."""
    random = np.random.default_rng(9)
    theta, theta_a = np.radians(random.uniform(0, 89, (2, 20000)))
    phi, phi_other, phi_a = random.uniform(0, 2 * np.pi, (3, 20000))

    def grooves(grazing_deg: float) -> FloatArray:
        grazing = np.full(theta.size, math.radians(grazing_deg))
        there, other = (grazing, phi), (theta, phi_other)
        towards = Directions(*there, *other) if lamp else Directions(*other, *there)
        return np.array(unidirectional_single_slope(towards, theta_a, phi_a))

    limit, value = grooves(90 - 1e-6), grooves(90.0)
    across = np.minimum(np.tan(theta_a) * np.abs(np.cos(phi - phi_a)), 1)
    error, total = np.abs(value - limit).sum(axis=0), value.sum(axis=0)
    assert np.all(error * across <= 1e-6 * total)  # the angle of ray and groove is 1e-8 / across
    assert value[1].max() > 0.1


def test_open_facets_exchange_pi_times_one_minus_cosine() -> None:
    # (24) at no masking and no shadowing, as in (48)
    theta_a = np.radians([0.0, 10.0, 45.0, 89.0])
    factor = interreflection_factor(UP, UP, theta_a)
    np.testing.assert_allclose(factor, np.pi * (1 - np.cos(theta_a)), atol=1e-14)


def test_one_facet_is_finite_at_the_ends_of_the_domain() -> None:
    random = np.random.default_rng(8)
    ends = np.array([0.0, 1e-300, 1e-9, 0.7, np.pi / 2 - 1e-9, np.pi / 2])
    theta_i, theta_r, theta_a = random.choice(ends, (3, 3000))
    phi_i, phi_r, phi_a = random.choice([0.0, np.pi / 2, np.pi, 2.0], (3, 3000))
    towards = Directions(theta_i, phi_i, theta_r, phi_r)
    with np.errstate(all="raise", under="ignore"):
        found = [attenuation(towards, theta_a, phi_a), critical_angle(theta_i, theta_a)]
        widths = (f(towards, theta_a, phi_a) for f in (masked_width, shadowed_width))
        found += [interreflection_factor(*widths, theta_a)]
        found += unidirectional_single_slope(towards, theta_a, phi_a)
    assert all(np.all(np.isfinite(value) & (value >= 0)) for value in found)


def test_the_critical_angles_divide_the_facets_as_in_table_2() -> None:
    for theta_i, theta_r, theta_a, phi_r, _ in random_cavities(200, 7):
        towards = Directions(*(np.array(x) for x in (theta_i, 0.0, theta_r, phi_r)))
        slope, azimuth = np.array(theta_a), np.linspace(0, 2 * np.pi, 181)
        for theta, phi, hidden in (
            (theta_i, 0.0, shadowed_width(towards, slope, azimuth + np.pi)),
            (theta_r, phi_r, masked_width(towards, slope, azimuth)),
        ):
            critical = critical_angle(np.array(theta), slope)
            off = np.abs(np.angle(np.exp(1j * (azimuth - phi))))  # from the direction's azimuth
            within, opposite = off < critical - 1e-9, off > np.pi - critical + 1e-9
            between = (off > critical + 1e-9) & (off < np.pi - critical - 1e-9)
            assert np.all((hidden[within] > 0) & (hidden[within] < 1))
            assert np.all(hidden[between] == 0)
            assert np.all(hidden[opposite] == 1)


@pytest.mark.parametrize("which", ["theta_i", "theta_r", "theta_a"])
@pytest.mark.parametrize("wrong", [-0.1, 1.6, math.nan])
def test_angles_outside_the_hemisphere_are_refused(which: str, wrong: float) -> None:
    angles = {"theta_i": np.array(0.5), "theta_r": np.array(0.6), "theta_a": np.array(0.7)}
    theta_i, theta_r, theta_a = (angles | {which: np.array(wrong)}).values()
    towards = Directions(theta_i, UP, theta_r, np.array(1.0))
    words = f"{which} = {wrong:.12g} radians; allowed: 0 to pi/2"
    for one_facet in (attenuation, unidirectional_single_slope):
        with pytest.raises(ValueError, match=words):
            one_facet(towards, theta_a, UP)
