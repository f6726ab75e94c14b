"""Contract of every camera: simulated, V4L2 on the emulated device, and a real one.

A real camera is tested only with `--allow-motion --camera /dev/v4l/by-id/...`. It needs light that
does not flicker, and must offer 640 x 480 pixels of 8 bit.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from drivers.v4l2.camera import V4l2Camera
from instrument.clock import SystemClock
from instrument.config.load import load_protocol
from instrument.devices import Camera
from instrument.errors import DeviceError
from sim.clock import SimulatedClock
from sim.scene.camera import SimulatedCamera
from sim.scene.scene import Scene
from tests.support.paths import CONFIGS
from tests.support.v4l2.remote_camera import QUICK, SETTINGS, LevelScene, child, served

EXPOSURES_S = (0.001, 0.004, 0.002)


@pytest.fixture(params=["simulated", "v4l2", pytest.param("real", marks=pytest.mark.hil)])
def camera(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Camera]:
    if request.param == "simulated":
        loaded = load_protocol(CONFIGS / "protocols" / "demo.yaml")
        scene = Scene.of(loaded.rig, loaded.protocol)
        for axis, angle_deg in (("theta_i", 30.0), ("dphi", 0.0), ("theta_r", 0.0)):
            scene.set_axis(axis, angle_deg)
        yield SimulatedCamera(scene, SimulatedClock())
    elif request.param == "v4l2":
        with child(tmp_path_factory) as remote, served(remote, LevelScene(), QUICK):
            remote.ask("open", replace(SETTINGS, gain=None))
            yield remote  # type: ignore[misc]  # closed with its process
    else:
        if not request.config.getoption("--camera"):
            pytest.skip("no real camera: --allow-motion --camera /dev/v4l/by-id/...")
        device = request.config.getoption("--camera")
        settings = replace(
            SETTINGS, device=device, pixel_format="YUYV", width_px=640, height_px=480, bit_depth=8,
            max_exposure_s=0.1, gain=None,
        )  # fmt: skip
        with V4l2Camera(settings, SystemClock()) as real:
            yield real


def test_identity_states_the_bit_depth(camera: Camera) -> None:
    assert "bit" in camera.identity()


def test_frames_have_the_exposure_that_was_set(camera: Camera) -> None:
    for exposure_s in EXPOSURES_S:
        assert camera.set_exposure_s(exposure_s) == pytest.approx(exposure_s)
        assert [f.exposure_s for f in camera.grab(3)] == pytest.approx([exposure_s] * 3)


def test_an_exposure_out_of_range_is_refused(camera: Camera) -> None:
    camera.set_exposure_s(0.002)
    for exposure_s in (0.0, -1.0, 1e6, float("nan")):
        with pytest.raises(DeviceError, match=r"exposure .* s asked for"):
            camera.set_exposure_s(exposure_s)
    assert camera.grab(1)[0].exposure_s == pytest.approx(0.002)


def test_frames_are_images_of_counts_in_order(camera: Camera) -> None:
    camera.set_exposure_s(0.001)
    frames = camera.grab(5)
    assert len(frames) == 5
    assert {f.image.shape for f in frames} == {frames[0].image.shape}
    assert all(f.image.dtype in (np.uint8, np.uint16) and f.image.ndim == 2 for f in frames)
    times = [f.time_s for f in frames]
    assert times == sorted(set(times))


def test_a_frame_is_unchanged_when_others_are_taken(camera: Camera) -> None:
    camera.set_exposure_s(0.001)
    first = camera.grab(1)[0]
    before = first.image.copy()
    camera.set_exposure_s(0.004)
    camera.grab(6)
    assert np.array_equal(first.image, before)
