"""State of the simulated rig."""

from __future__ import annotations

import numpy as np
import pytest

from instrument.config.load import Loaded
from sim.scene.render import electrons_per_s
from tests.support.scans import changed, simulated_scene


def test_returning_to_an_angle_gives_the_same_true_angle(demo: Loaded) -> None:
    scene = simulated_scene(demo)
    scene.set_axis("theta_r", 20.0)
    first = scene.true_deg["theta_r"]
    scene.set_axis("theta_r", 40.0)
    scene.set_axis("theta_r", 20.0)
    assert scene.true_deg["theta_r"] == first != 20.0
    assert abs(first - 20.0) < 6 * demo.rig.axes.theta_r.u_deg


def test_the_albedo_texture_has_mean_0_and_the_requested_standard_deviation(demo: Loaded) -> None:
    scene = simulated_scene(demo)
    scene.sample = scene.sample.model_copy(update={"mottling": 0.03})
    texture, spacing_mm = scene.mottling()
    assert texture.mean() == pytest.approx(0.0, abs=1e-12)
    assert np.std(texture) == pytest.approx(0.03)
    assert texture.shape[0] * spacing_mm >= demo.protocol.sample.height_mm
    scene.surface = "white tile"
    assert not scene.mottling()[0].any()


def test_the_white_tile_has_a_height_of_its_own(demo: Loaded) -> None:
    """Else the tile would share the sample's error of placement, which the ratio then lacks."""
    rig = demo.rig
    tiles = []
    for seed in range(400):
        simulation = rig.simulation.model_copy(update={"seed": seed})
        scene = simulated_scene(changed(demo, rig={"simulation": simulation}))
        assert scene.heights_mm["sample"] == simulation.sample_height_mm
        tiles.append(scene.heights_mm["white tile"])
    assert np.mean(tiles) == pytest.approx(0.0, abs=0.2 * rig.u_placement_mm)
    assert np.std(tiles) == pytest.approx(rig.u_placement_mm, rel=0.15)


def test_a_higher_surface_sends_more_light(demo: Loaded) -> None:
    """At 20 mm above the axis the tile is 2 % closer to the lamp: 4 % more irradiance."""
    images = []
    for height_mm in (0.0, 20.0):
        scene = simulated_scene(demo, theta_i=0.0)
        scene.surface = "white tile"
        scene.heights_mm["white tile"] = height_mm
        images.append(electrons_per_s(scene)[250:260, 310:320].mean())
    assert images[1] / images[0] == pytest.approx((1000 / 980) ** 2, rel=2e-3)
