"""The emulated table's camera: the same picture of the scene, in colour where the rig has it."""

from __future__ import annotations

import pytest

from instrument.clock import SystemClock
from instrument.config.camera import V4l2CameraConfig
from sim.emulated.bench import EmulatedBench
from sim.emulated.v4l2.device import Exposure, PixelFormat
from sim.scene.scene import Scene
from tests.support.scans import shrunk, small_scan

RESPONSES = [0.5, 1.0, 0.8]


@pytest.mark.parametrize("pixel_format", ["RGB3", "BGR3"])
def test_a_camera_in_colour_sends_each_channel_with_its_response(pixel_format: PixelFormat) -> None:
    rig = shrunk(small_scan("emulated"), 2).rig
    fields = {"pixel_format": pixel_format, "bit_depth": 8, "channels": 3, "black_level_dn": 8.0}
    camera = rig.camera.model_copy(update=fields)
    simulation = rig.simulation.model_copy(update={"channel_responses": RESPONSES})
    scene = Scene.of_white_sample(
        rig.model_copy(update={"camera": camera, "simulation": simulation})
    )
    assert isinstance(camera, V4l2CameraConfig)
    emulated = EmulatedBench(scene, SystemClock()).camera(camera)
    size = camera.width_px, camera.height_px
    exposure = Exposure(0.001, 0, 0.0, 0, pixel_format, *size)
    sent = emulated.frame_bytes(exposure, emulated.snapshot()).reshape(*size[::-1], 3)
    colour = sent if pixel_format == "RGB3" else sent[..., ::-1]
    light = colour.astype(float) - camera.black_level_dn
    bright = (light[..., 1] > 50) & (colour < camera.max_dn).all(axis=-1)
    assert bright.sum() > 100
    means = light[bright].mean(axis=0)
    assert means / means[1] == pytest.approx(RESPONSES, abs=0.02)
