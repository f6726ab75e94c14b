"""The rendered image: flux, and interpolation between the Chebyshev nodes."""

from __future__ import annotations

import numpy as np
import pytest

import sim.scene.render
from instrument.config.load import Loaded
from instrument.pinhole import Pinhole, area_per_pixel_mm2
from sim.scene.render import electrons_per_s
from tests.support.scans import changed, exact_rig, simulated_scene


def test_a_lambertian_sample_keeps_its_flux_at_every_view_angle(demo: Loaded) -> None:
    """The image integrated over the pixels' area on the sample is radiance times sample area."""
    sample = demo.protocol.simulated_sample
    assert sample is not None
    flat = sample.model_copy(
        update={"model": "lambert", "parameters": {"albedo": 0.8}, "mottling": 0.0}
    )
    simulation = exact_rig(demo.rig).simulation.model_copy(update={"background_reflectance": 0.0})
    rig = exact_rig(demo.rig).model_copy(update={"simulation": simulation, "lamp_distance_mm": 1e6})
    loaded = changed(demo, rig=dict(rig), simulated_sample=flat)
    camera = Pinhole.of(rig)
    rows, columns = np.ogrid[: camera.height_px, : camera.width_px]
    for theta_r in (0.0, 50.0, -75.0):
        image = electrons_per_s(simulated_scene(loaded, 60.0, theta_r))
        area = area_per_pixel_mm2(camera.homography(theta_r), columns, rows)
        flux = np.sum(image / camera.cos4(columns, rows) * area) / (50.8 * 50.8)
        white = rig.lamp.white_electrons_per_s
        assert flux == pytest.approx(0.8 * white * np.cos(np.radians(60)), rel=1e-3)


@pytest.mark.parametrize("theta_r", [0.0, 50.0, -75.0])
def test_more_nodes_change_the_image_within_the_stated_error(
    demo: Loaded, monkeypatch: pytest.MonkeyPatch, theta_r: float
) -> None:
    """The bounds stated beside `_NODES`: largest where the model has a kink in view angle."""
    coarse = electrons_per_s(simulated_scene(demo, 60.0, theta_r))
    monkeypatch.setattr(sim.scene.render, "_NODES", 31)
    fine = electrons_per_s(simulated_scene(demo, 60.0, theta_r))
    assert np.max(np.abs(coarse - fine)) < 4e-5 * fine.max()
    assert abs(np.mean(coarse - fine)) < 5e-6 * fine.mean()
