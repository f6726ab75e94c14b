"""Angles about a normal are those of its frame, and of a planet's longitude and latitude."""

import math

import numpy as np
import pytest

from analysis.rendering.angles import local_geometry, longitudes
from analysis.rendering.surface import unit
from instrument.geometry import FloatArray, Geometry

RNG = np.random.default_rng(231)


def facing(count: int) -> FloatArray:
    """Random unit vectors (count, 3) of which each has z above 0."""
    found = unit(RNG.normal(size=(count, 3)))
    found[:, 2] = np.abs(found[:, 2])
    return found


def test_angles_are_those_of_the_frame_about_the_normal() -> None:
    normal, lamp = facing(50), facing(1)[0]
    normal = normal[normal @ lamp > 0]
    found = local_geometry(normal, lamp)
    for k, n in enumerate(normal):
        across_it = unit(np.cross(n, RNG.normal(size=3)))
        frame = np.stack([across_it, np.cross(n, across_it), n])
        own = Geometry.from_directions(frame @ lamp, frame[:, 2])
        assert found.theta_i_deg[k] == pytest.approx(own.theta_i_deg, abs=1e-9)
        assert found.theta_r_deg[k] == pytest.approx(own.theta_r_deg, abs=1e-9)
        assert math.cos(math.radians(found.dphi_deg[k] - own.dphi_deg)) == pytest.approx(1)


def test_longitude_and_latitude_give_the_angles_of_lamp_and_viewer() -> None:
    normal, lamp = facing(50), facing(1)[0]
    longitude, latitude, phase = longitudes(normal, lamp)
    assert np.cos(latitude) * np.cos(longitude) == pytest.approx(normal[:, 2])
    assert np.cos(latitude) * np.cos(longitude - phase) == pytest.approx(normal @ lamp)
