"""Averaging over lamp, lens and patch, compared with exact cases and with random rays."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.data.acceptance import Acceptance, averaged_brdf, disc_rule, radiance, required_rings
from analysis.models import MODELS
from instrument.config.load import Loaded
from instrument.geometry import FloatArray, Geometry, camera_direction, lamp_direction
from tests.support.analysis.seeded_scan import RIG

THETA_I = np.array([30.0, 45.0, 60.0, 0.0])
THETA_R = np.array([-70.0, -45.0, 55.0, 20.0])
DPHI = np.array([0.0, 0.0, 40.0, 0.0])


def lambert(geometry: Geometry) -> FloatArray:
    return MODELS["lambert"].brdf(geometry, albedo=0.8)


def rough(geometry: Geometry) -> FloatArray:
    return MODELS["oren_nayar+torrance_sparrow"].brdf(geometry, albedo=0.8, sigma_deg=8, ks=0.1)


def disc_moment(p: int, q: int) -> float:
    """Mean of x^p y^q over the unit disc, by the gamma function."""
    if p % 2 or q % 2:
        return 0.0
    g = math.gamma
    return 2 * g((p + 1) / 2) * g((q + 1) / 2) / g((p + q) / 2 + 1) / (p + q + 2) / math.pi


@given(rings=st.integers(1, 5), turn=st.floats(0, 1), data=st.data())
def test_the_disc_rule_is_exact_for_polynomials(
    rings: int, turn: float, data: st.DataObject
) -> None:
    p = data.draw(st.integers(0, 4 * rings - 1))
    q = data.draw(st.integers(0, 4 * rings - 1 - p))
    nodes, weights = disc_rule(rings, turn)
    assert nodes.shape == (4 * rings**2, 2)
    found = float(weights @ (nodes[:, 0] ** p * nodes[:, 1] ** q))
    assert found == pytest.approx(disc_moment(p, q), abs=1e-14)


def test_zero_rings_are_the_centre() -> None:
    nodes, weights = disc_rule(0)
    assert nodes.tolist() == [[0, 0]]
    assert weights.tolist() == [1]
    with pytest.raises(ValueError, match="rings = -1"):
        disc_rule(-1)


@given(
    theta_i=st.floats(0, 85), theta_r=st.floats(-85, 85), dphi=st.floats(0, 360),
    rings=st.integers(0, 3),
)  # fmt: skip
def test_a_lambertian_brdf_is_not_changed(
    theta_i: float, theta_r: float, dphi: float, rings: int
) -> None:
    found = averaged_brdf(lambert, theta_i, theta_r, dphi, RIG, rings)
    assert found == pytest.approx(0.8 / np.pi, rel=1e-13)


def test_a_small_rig_measures_the_plain_brdf() -> None:
    plain = rough(Geometry.from_degrees(theta_i=THETA_I, theta_r=THETA_R, dphi=DPHI))
    errors = []
    for part in (1.0, 0.1, 0.01):
        small = replace(
            RIG,
            source_solid_angle_sr=0.003 * part,
            receiver_solid_angle_sr=0.0009 * part,
            patch_width_mm=20 * part,
            patch_height_mm=20 * part,
        )
        found = averaged_brdf(rough, THETA_I, THETA_R, DPHI, small, 3)
        errors.append(np.max(np.abs(found / plain - 1)))
    assert errors[0] > 1e-3  # it matters for the full-size rig
    # At a kink (theta_i = theta_r) the change is proportional to the radius: root of 10 each time.
    assert errors[1] < errors[0] / 2.5
    assert errors[2] < errors[1] / 2.5


def monte_carlo(theta_i: float, theta_r: float, dphi: float, draws: int) -> tuple[float, float]:
    """Mean BRDF and its standard error from random points of lamp, lens and patch."""
    rng = np.random.default_rng(7)

    def disc(direction: FloatArray, distance: float, solid_angle: float) -> FloatArray:
        radius = distance * math.tan(math.acos(1 - solid_angle / (2 * math.pi)))
        r, a = radius * np.sqrt(rng.random(draws)), 2 * np.pi * rng.random(draws)
        first = np.cross(direction, [0.3, 0.5, 0.8])
        first /= np.linalg.norm(first)
        second = np.cross(direction, first)
        across = np.outer(np.cos(a), first) + np.outer(np.sin(a), second)
        return np.asarray(distance * direction + r[:, np.newaxis] * across)

    point = np.column_stack([rng.uniform(-10, 10, (draws, 2)), np.zeros(draws)])
    to_lamp = disc(lamp_direction(theta_i, dphi), 1500.0, 0.003) - point
    to_lens = disc(camera_direction(theta_r), 1828.8, 0.0009) - point
    r_lamp, r_lens = np.linalg.norm(to_lamp, axis=1), np.linalg.norm(to_lens, axis=1)
    geometry = Geometry.from_directions(to_lamp / r_lamp[:, None], to_lens / r_lens[:, None])
    weight = to_lamp[:, 2] / r_lamp**3 * to_lens[:, 2] / r_lens**3
    f = rough(geometry)
    mean = float(np.sum(weight * f) / np.sum(weight))
    spread = float(np.sqrt(np.mean((weight * (f - mean)) ** 2)) / np.mean(weight))
    return mean, spread / math.sqrt(draws)


@pytest.mark.parametrize("n", range(4))
def test_against_random_rays(n: int) -> None:
    mean, u = monte_carlo(THETA_I[n], THETA_R[n], DPHI[n], 200_000)
    found = averaged_brdf(rough, THETA_I[n], THETA_R[n], DPHI[n], RIG, 3)
    assert found == pytest.approx(mean, abs=4 * u)
    assert u / mean < 3e-4  # the comparison is precise enough


def test_radiance_shapes_and_unit_irradiance() -> None:
    points = np.zeros((5, 3))
    assert radiance(lambert, points, THETA_I, THETA_R, DPHI, RIG, 1).shape == (4, 5)
    assert radiance(lambert, points.reshape(5, 1, 3), 30.0, 0.0, 0.0, RIG, 1).shape == (5, 1)
    for rings in (0, 1, 3):
        found = radiance(lambert, np.zeros(3), 0.0, 20.0, 0.0, RIG, rings)
        assert found == pytest.approx(0.8 / np.pi, rel=1e-13)


def test_light_falls_with_the_square_of_the_distance_and_the_cosine() -> None:
    small = replace(RIG, source_solid_angle_sr=0.0, receiver_solid_angle_sr=0.0)
    point = np.array([30.0, -10.0, 2.0])
    to_lamp = 1500 * lamp_direction(40.0, 25.0) - point
    r = float(np.linalg.norm(to_lamp))
    expected = 0.8 / np.pi * (to_lamp[2] / r) * (1500 / r) ** 2
    found = radiance(lambert, point, 40.0, -20.0, 25.0, small, 2)
    assert found == pytest.approx(expected, rel=1e-12)


def test_only_the_part_of_a_lens_above_the_horizon_counts() -> None:
    found = averaged_brdf(lambert, 40.0, [-90.0, 89.9, 90.0], 0.0, RIG, 3)
    np.testing.assert_allclose(found, 0.8 / np.pi, rtol=1e-12)
    above = np.array([0.0, 0.0, 500.0])  # from here the whole lens is below the horizon
    assert radiance(lambert, above, 40.0, 90.0, 0.0, RIG, 2) == 0
    assert radiance(lambert, above, 90.0, 0.0, 0.0, RIG, 2) == 0


def test_no_light_is_an_error() -> None:
    def shadowed(theta_i: float) -> None:
        averaged_brdf(lambert, theta_i, 90.0, 180.0, RIG, 0, patch_nodes=2)

    shadowed(89.0)  # half of the patch still sees the lens
    with pytest.raises(ValueError, match="theta_i = 95 degrees"):
        averaged_brdf(lambert, 95.0, 0.0, 0.0, RIG, 1)


def test_required_rings_reach_the_tolerance() -> None:
    assert required_rings(lambert, THETA_I, THETA_R, DPHI, RIG).max() == 0
    rings = int(required_rings(rough, THETA_I, THETA_R, DPHI, RIG).max())
    assert 1 <= rings <= 4
    found = averaged_brdf(rough, THETA_I, THETA_R, DPHI, RIG, rings)
    dense = averaged_brdf(rough, THETA_I, THETA_R, DPHI, RIG, 6)
    np.testing.assert_allclose(found, dense, rtol=3e-4)
    assert required_rings(rough, THETA_I, THETA_R, DPHI, RIG, tolerance=1e-12, most=2).max() == 2


def test_from_the_configuration(demo: Loaded) -> None:
    found = Acceptance.of(demo.rig, demo.protocol.window)
    assert found.beam_length_mm == demo.rig.beam_length_mm
    assert found.lamp_distance_mm == demo.rig.lamp_distance_mm
    assert found.source_solid_angle_sr == demo.rig.source_solid_angle_sr
    assert found.receiver_solid_angle_sr == demo.rig.receiver_solid_angle_sr
    assert found.patch_width_mm == demo.protocol.window.width_mm
    assert found.patch_height_mm == demo.protocol.window.height_mm


@pytest.mark.parametrize(
    ("name", "value"),
    [("beam_length_mm", 0.0), ("lamp_distance_mm", -1.0), ("source_solid_angle_sr", 1.5),
     ("receiver_solid_angle_sr", -0.1), ("patch_width_mm", -1.0), ("patch_height_mm", math.nan)],
)  # fmt: skip
def test_impossible_sizes_are_named(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name} = {value:g}; allowed"):
        replace(RIG, **{name: value})
