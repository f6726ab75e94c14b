"""The convention of angles: signs, directions, and refused values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from instrument.geometry import (
    Geometry,
    camera_direction,
    camera_to_lamp_deg,
    cone_half_angle_deg,
    lamp_direction,
)

VIEW = st.floats(-89, 89)
INCIDENCE = st.floats(0.001, 89)
AZIMUTH = st.floats(-360, 360)


def test_a_negative_view_angle_means_the_other_side() -> None:
    g = Geometry.from_degrees(theta_i=30.0, theta_r=[-20.0, 20.0], dphi=[10.0, 350.0])
    assert g.theta_r_deg.tolist() == [20.0, 20.0]
    assert g.dphi_deg.tolist() == [190.0, 350.0]
    assert g.shape == g.theta_i_deg.shape == (2,)


@given(INCIDENCE, VIEW, AZIMUTH)
def test_directions_and_angles_describe_the_same_geometry(
    theta_i: float, theta_r: float, dphi: float
) -> None:
    g = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    lamp, camera = lamp_direction(theta_i, dphi), camera_direction(theta_r)
    assert np.linalg.norm(lamp) == pytest.approx(1.0)
    same = Geometry.from_directions(lamp, camera)
    assert same.theta_i_deg == pytest.approx(g.theta_i_deg, abs=1e-6)
    assert same.theta_r_deg == pytest.approx(g.theta_r_deg, abs=1e-6)
    if abs(theta_r) > 0.001:  # at normal view the azimuth is undefined
        assert np.cos(np.radians(same.dphi_deg)) == pytest.approx(g.cos_dphi, abs=1e-6)


def test_dphi_0_is_the_side_of_the_lamp_and_180_the_mirror_side() -> None:
    assert camera_to_lamp_deg(30.0, 30.0, 0.0) == pytest.approx(0.0, abs=1e-6)
    assert camera_to_lamp_deg(30.0, 30.0, 180.0) == pytest.approx(60.0)
    assert camera_to_lamp_deg(30.0, -30.0, 0.0) == pytest.approx(60.0)
    assert Geometry.from_degrees(theta_i=1.0, theta_r=-1.0).cos_dphi == pytest.approx(-1.0)


@pytest.mark.parametrize(
    ("angles", "words"),
    [
        ({"theta_i": -1.0, "theta_r": 0.0}, "theta_i = -1 degrees; allowed: 0 to 90 degrees"),
        ({"theta_i": 0.0, "theta_r": 90.5}, "theta_r = 90.5 degrees; allowed: -90 to 90 degrees"),
        ({"theta_i": 0.0, "theta_r": np.nan}, "theta_r = nan degrees"),
        ({"theta_i": -1e-9, "theta_r": 0.0}, "theta_i = -1e-09 degrees; allowed: 0 to 90 degrees"),
        ({"theta_i": [0, 90.0000001], "theta_r": 0.0}, "theta_i = 90.0000001 degrees; allowed: 0"),
        ({"theta_i": 0.0, "theta_r": [-90.5, 3]}, "theta_r = -90.5 degrees; allowed: -90 to 90"),
        ({"theta_i": np.nan, "theta_r": 0.0}, "theta_i = nan degrees"),
        ({"theta_i": 0.0, "theta_r": 0.0, "dphi": np.inf}, "dphi = inf degrees; allowed: finite"),
    ],
)
def test_an_impossible_angle_is_refused_by_name(angles: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Geometry.from_degrees(**angles)


def test_blocks_are_the_whole_in_order() -> None:
    g = Geometry.from_degrees(theta_i=np.arange(10.0).reshape(2, 5), theta_r=5.0)
    parts = list(g.blocks(4))
    assert [part for part, _ in parts] == [slice(0, 4), slice(4, 8), slice(8, 12)]
    assert np.concatenate([b.theta_i_deg for _, b in parts]).tolist() == list(range(10))


def test_two_geometries_are_equal_only_if_they_are_the_same_object() -> None:
    one, other = (Geometry.from_degrees(theta_i=1.0, theta_r=2.0) for _ in range(2))
    assert one == one  # noqa: PLR0124  # identity is the promise
    assert one != other
    assert len({one: 1, other: 2}) == 2


def test_a_hemisphere_is_a_cone_of_90_degrees() -> None:
    assert cone_half_angle_deg(2 * np.pi) == pytest.approx(90.0)
    assert cone_half_angle_deg(np.pi * 0.01**2) == pytest.approx(np.degrees(0.01), rel=1e-4)
