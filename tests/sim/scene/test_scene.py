"""State of the simulated rig."""

from __future__ import annotations

import numpy as np
import pytest

from instrument.config.load import Loaded
from tests.support.scans import simulated_scene


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
