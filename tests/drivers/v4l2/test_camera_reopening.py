"""V4L2 camera that is lost and returns: reported in time, reopened with all its settings."""

from __future__ import annotations

import errno
import time
from collections.abc import Callable
from dataclasses import replace

import pytest

from drivers.v4l2 import ioctl
from instrument.errors import CameraLost, DeviceError
from sim.emulated.v4l2.device import EmulatedCamera
from tests.support.v4l2.remote_camera import (
    FOUND_WITHIN_S,
    SETTINGS,
    WHO,
    LevelScene,
    RemoteCamera,
    level,
    served,
    steps,
)

pytestmark = pytest.mark.real_time


@pytest.mark.parametrize("exposure_s", [0.001, 0.5])
@pytest.mark.parametrize(
    ("strike", "message"),
    [
        (EmulatedCamera.unplug, r"is gone \(No such device\), unplugged.*USB cable"),
        (lambda camera: setattr(camera.faults, "frozen", True), "stands still.*USB cable"),
    ],
    ids=["unplugged", "frozen"],
)
def test_a_lost_camera_is_reported_in_time(
    remote: RemoteCamera,
    scene: LevelScene,
    strike: Callable[[EmulatedCamera], None],
    message: str,
    exposure_s: float,
) -> None:
    """Measured: unplugged within 2 ms, frozen at the exposure and 1.01 s."""
    with served(remote, scene) as camera:
        remote.ask("open", SETTINGS)
        remote.set_exposure_s(exposure_s)
        remote.begin("grab", 100_000)
        scene.wait_exposures(3)
        strike(camera)
        start_s = time.monotonic()
        with pytest.raises(DeviceError, match=f"{WHO}: .*{message}"):
            remote.answer()
        assert time.monotonic() - start_s < exposure_s + FOUND_WITHIN_S


def test_a_camera_plugged_in_again_gets_its_settings_back(
    remote: RemoteCamera, scene: LevelScene
) -> None:
    with served(remote, scene) as camera:
        remote.ask("open", SETTINGS)
        remote.set_exposure_s(0.0077)
        camera.unplug()
        with pytest.raises(DeviceError, match="is gone"):
            remote.grab(1)
        camera.replug()
        assert camera.value(ioctl.GAIN) == 100
        assert camera.value(ioctl.EXPOSURE_AUTO) == 3
        scene.level = 5
        frames = remote.grab(3)
        assert [(level(frame), steps(frame)) for frame in frames] == [(5, 77)] * 3
        assert camera.value(ioctl.EXPOSURE_AUTO) == 1
        assert (camera.pixel_format, camera.size) == ("Y16", (64, 48))


def test_each_call_tries_once_to_reopen_a_missing_camera(
    remote: RemoteCamera, scene: LevelScene
) -> None:
    """The caller decides how long to wait for it."""
    with served(remote, scene) as camera:
        remote.ask("open", SETTINGS)
        camera.unplug()
        with pytest.raises(DeviceError, match="is gone"):
            remote.set_exposure_s(0.005)
        for _ in range(3):
            tries = camera.requests["open"]
            with pytest.raises(CameraLost, match="cannot be opened"):
                remote.set_exposure_s(0.005)
            assert camera.requests["open"] == tries + 1
        camera.replug()
        assert remote.set_exposure_s(0.005) == 0.005
        assert steps(remote.grab(1)[0]) == 50
        assert remote.ask("said") == []  # an unplugging is one message, of the caller


def test_another_camera_in_its_place_is_refused(remote: RemoteCamera, scene: LevelScene) -> None:
    with served(remote, scene) as camera:
        remote.ask("open", SETTINGS)
        camera.unplug()
        with pytest.raises(DeviceError, match="is gone"):
            remote.grab(1)
        camera.capabilities = replace(camera.capabilities, card="A webcam")
        camera.replug()
        with pytest.raises(DeviceError, match="A webcam answers where Emulated camera did"):
            remote.grab(1)


def test_settings_are_verified_again_when_the_camera_is_reopened(
    remote: RemoteCamera, scene: LevelScene
) -> None:
    with served(remote, scene) as camera:
        remote.ask("open", SETTINGS)
        camera.unplug()
        with pytest.raises(DeviceError, match="is gone"):
            remote.grab(1)
        camera.replug()
        camera.faults.stuck_controls.add(ioctl.EXPOSURE_AUTO)
        with pytest.raises(DeviceError, match="manual exposure"):
            remote.grab(1)
        camera.faults.stuck_controls.clear()
        assert steps(remote.grab(1)[0]) == 10


def test_a_frozen_stream_is_restarted(remote: RemoteCamera, scene: LevelScene) -> None:
    with served(remote, scene) as camera:
        remote.ask("open", SETTINGS)
        camera.faults.frozen = True
        with pytest.raises(DeviceError, match="stands still"):
            remote.grab(1)
        camera.faults.frozen = False
        scene.level = 9
        assert [level(frame) for frame in remote.grab(2)] == [9, 9]


def test_a_stream_that_lost_all_its_buffers_is_reopened(
    remote: RemoteCamera, scene: LevelScene
) -> None:
    with served(remote, scene) as camera:
        remote.ask("open", SETTINGS)
        camera.faults.fail("QBUF", errno.EIO, times=4)
        with pytest.raises(DeviceError, match="stands still"):
            remote.grab(20)
        camera.faults.failing["QBUF"].clear()  # as many failed as there were frames in time
        assert len(remote.grab(20)) == 20
