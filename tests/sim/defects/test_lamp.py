"""Lamp that warms up and lights unevenly, and the light that comes back from the walls."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from analysis.models import MODELS
from instrument.config.rig import Simulation
from instrument.config.simulated.defects import LampDefects
from instrument.geometry import FloatArray, Geometry
from sim.defects.lamp import beam_profile, wall_radiance, warm_up_level
from sim.scene.render import electrons_per_s
from tests.support.scans import changed, simulated_scene, small_scan


def test_a_lamp_warms_up_by_its_share_and_time() -> None:
    lamp = LampDefects(warm_up=0.05, warm_up_s=60.0)
    assert warm_up_level(0.0, lamp) == 0.95
    assert warm_up_level(60.0, lamp) == pytest.approx(1 - 0.05 / math.e)
    assert warm_up_level(1e6, lamp) == 1.0
    assert warm_up_level(0.0, LampDefects()) == 1.0


def test_the_beam_is_half_as_bright_at_half_its_width() -> None:
    lamp = LampDefects(spot_fwhm_mm=100.0)
    points = np.array([[0.0, 0.0, 0.0], [50.0, 0.0, 0.0], [0.0, -50.0, 0.0]])
    assert beam_profile(points, 0.0, 0.0, lamp) == pytest.approx([1.0, 0.5, 0.5])
    # At 60 deg, a point in the plane of incidence is only half as far from the beam's axis.
    assert beam_profile(2 * points, 60.0, 0.0, lamp) == pytest.approx([1.0, 0.5, 0.5**4])
    assert beam_profile(2 * points, 60.0, 90.0, lamp) == pytest.approx([1.0, 0.5**4, 0.5])
    assert np.all(beam_profile(points, 60.0, 90.0, LampDefects()) == 1.0)


def test_a_beam_aimed_aside_lights_one_side_more() -> None:
    lamp = LampDefects(spot_fwhm_mm=100.0, aim_x_mm=5.0, aim_y_mm=-3.0)
    place = np.array([[5.0, -3.0, 0.0], [5.0, 3.0, 0.0], [-5.0, -3.0, 0.0]])
    values = beam_profile(place, 0.0, 0.0, lamp)
    assert values.argmax() in (0, 1)
    assert values.max() == pytest.approx(1.0)
    assert values[2] < 1.0


def matt(geometry: Geometry) -> FloatArray:
    return MODELS["lambert"].brdf(geometry, albedo=0.6)


def rough(geometry: Geometry) -> FloatArray:
    return MODELS["oren_nayar"].brdf(geometry, albedo=0.6, sigma_deg=30.0)


@pytest.mark.parametrize("theta_r", [-80.0, 0.0, 35.0])
def test_walls_light_a_matt_surface_equally_in_all_directions(theta_r: float) -> None:
    assert wall_radiance(matt, theta_r, 0.01) == pytest.approx(0.01 * 0.6 / np.pi, rel=1e-12)
    assert wall_radiance(rough, theta_r, 0.01) == wall_radiance(rough, -theta_r, 0.01)
    assert wall_radiance(rough, theta_r, 0.0) == 0.0


def test_light_of_the_walls_on_a_rough_surface_is_its_integral_over_the_hemisphere() -> None:
    theta, azimuth = np.meshgrid((np.arange(450) + 0.5) / 5, np.arange(0.5, 360.0, 2.0))
    geometry = Geometry.from_degrees(theta_i=theta, theta_r=40.0, dphi=azimuth)
    t = np.radians(theta)
    ring = np.radians(0.2) * np.radians(2.0) * np.sin(t) * np.cos(t)
    whole = float((rough(geometry) * ring).sum()) / np.pi
    assert wall_radiance(rough, 40.0, 0.02) == pytest.approx(0.02 * whole, rel=2e-3)


def picture(defects: dict[str, Any], surface: str = "white tile") -> Any:
    small = small_scan()
    own = Simulation.model_validate({**small.rig.simulation.model_dump(), **defects})
    scene = simulated_scene(changed(small, rig={"simulation": own}), theta_i=60.0)
    scene.surface = "white tile" if surface == "white tile" else "sample"
    return electrons_per_s(scene)


def test_walls_add_to_the_light_that_a_slanting_lamp_gives() -> None:
    """At theta_i 60 the lamp gives half of its irradiance: 1 % by the walls is 2 % more light."""
    ratio = picture({"wall_light": 0.01}) / picture({})
    assert np.median(ratio[40:60, 50:75]) == pytest.approx(1.02, abs=1e-3)


def test_the_beam_shows_in_the_picture() -> None:
    narrow = picture({"lamp_defects": {"spot_fwhm_mm": 60.0}}) / picture({})
    assert narrow[50, 63] == pytest.approx(1.0, abs=0.01)
    assert narrow[20, 63] < 0.9
