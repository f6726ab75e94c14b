"""State of the simulated rig."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from instrument.config.load import Loaded
from instrument.config.simulated.sample import SimulatedSample
from sim.scene.render import electrons_per_s
from sim.scene.scene import log_normal
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


@pytest.mark.parametrize("seed", range(12))
def test_no_place_of_a_mottled_sample_reflects_less_than_nothing(demo: Loaded, seed: int) -> None:
    """Up to the largest mottling that is allowed, which keeps its meaning."""
    random = np.random.default_rng(seed)
    mottling = 0.3 if seed < 3 else float(random.uniform(0.0, 0.3))
    pattern = {"mottling": mottling, "mottling_size_mm": 10 ** random.uniform(-0.5, 3)}
    simulation = demo.rig.simulation.model_copy(update={"seed": int(random.integers(2**31))})
    scene = simulated_scene(changed(demo, rig={"simulation": simulation}))
    scene.sample = scene.sample.model_copy(update=pattern)
    texture, _ = scene.mottling()
    assert texture.min() > -1
    assert texture.mean() == pytest.approx(0.0, abs=1e-12)
    assert np.std(texture) == pytest.approx(mottling, rel=1e-4)
    if seed < 3:
        assert electrons_per_s(scene).min() > 0


@pytest.mark.parametrize("mottling", [-0.01, 0.301, 1.0, float("nan")])
def test_a_mottling_that_would_not_be_that_of_a_sample_is_refused(mottling: float) -> None:
    with pytest.raises(ValidationError, match="mottling"):
        SimulatedSample(model="lambert", parameters={"albedo": 0.5}, mottling=mottling)


@pytest.mark.parametrize("seed", range(20))
def test_a_log_normal_variation_has_the_deviation_asked_for(seed: int) -> None:
    """Also of a few normal deviates."""
    random = np.random.default_rng(seed)
    normal = random.standard_normal(int(random.integers(4, 2000)))
    normal = (normal - normal.mean()) / normal.std()
    deviation = float(10 ** random.uniform(-300, -1)) if seed % 4 == 0 else random.uniform(0.0, 0.3)
    found = log_normal(normal, deviation)
    assert found.min() > -1
    assert np.array_equal(np.argsort(found), np.argsort(normal))
    assert np.std(found / deviation) == pytest.approx(1.0, rel=1e-4)


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
