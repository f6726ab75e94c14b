"""Devices of a rig file: opened on request, closed together, simulated without a protocol."""

from __future__ import annotations

import pytest

from acquisition.rig import OpenRig, open_devices
from instrument.config.load import Loaded
from instrument.errors import DeviceError, InputError
from sim.scene.camera import SimulatedCamera
from sim.scene.stage import SimulatedStage
from tests.support.scans import changed


def test_a_rig_alone_shows_a_white_sample(demo: Loaded) -> None:
    with OpenRig(demo.rig) as rig:
        rig.pose_scene(theta_r_deg=20.0)
        camera = rig.camera()
        camera.set_exposure_s(0.01)
        image = camera.grab(1)[0].image
    assert image.shape == (demo.rig.camera.height_px, demo.rig.camera.width_px)
    # The sample in the middle of the picture is much brighter than the table around it.
    assert image[200:300, 250:350].mean() > 3 * image[:20, :20].mean()


def test_every_device_is_closed_if_one_cannot_be_opened(
    demo: Loaded, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed: list[object] = []

    def close(stage: SimulatedStage) -> None:
        closed.append(stage)

    def no_camera(*_: object) -> None:
        raise DeviceError("camera: cannot be opened")

    monkeypatch.setattr(SimulatedStage, "close", close)
    monkeypatch.setattr(SimulatedCamera, "__init__", no_camera)
    with pytest.raises(DeviceError, match="camera: cannot be opened"):
        open_devices(demo)
    assert len(closed) == 3


def test_a_simulated_rig_needs_a_simulated_sample(demo: Loaded) -> None:
    with pytest.raises(InputError, match=r"simulated_sample: missing, but the rig .* is simulated"):
        open_devices(changed(demo, simulated_sample=None))
