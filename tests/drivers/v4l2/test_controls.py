"""V4L2 controls: automatic ones are switched off, and every value is read back."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.v4l2 import ioctl
from instrument.errors import DeviceError
from tests.support.v4l2.remote_camera import (
    SETTINGS,
    WHO,
    LevelScene,
    RemoteCamera,
    served,
    steps,
)


def test_nothing_is_left_automatic(remote: RemoteCamera, scene: LevelScene) -> None:
    with served(remote, scene) as camera:
        remote.ask("open", SETTINGS)
        standing = {c.number: c.value for c in camera.controls().values()}
    assert standing == {
        ioctl.EXPOSURE_AUTO: 1,
        ioctl.AUTOGAIN: 0,
        ioctl.AUTO_WHITE_BALANCE: 0,
        ioctl.GAMMA: 100,
        ioctl.GAIN: 100,
        ioctl.EXPOSURE_ABSOLUTE: 10,
    }


def test_a_camera_without_automatics_needs_none(remote: RemoteCamera, scene: LevelScene) -> None:
    spare = frozenset(
        {
            ioctl.EXPOSURE_AUTO,
            ioctl.AUTOGAIN,
            ioctl.AUTO_WHITE_BALANCE,
            ioctl.GAMMA,
            ioctl.GAIN,
        }
    )
    with served(remote, scene, without_controls=spare):
        remote.ask("open", replace(SETTINGS, gain=None))
        assert steps(remote.grab(1)[0]) == 10


def test_a_clamped_exposure_is_an_error_and_the_previous_one_is_restored(
    remote: RemoteCamera, scene: LevelScene
) -> None:
    with served(remote, scene) as camera:
        remote.ask("open", SETTINGS)
        remote.set_exposure_s(0.002)
        camera.faults.clamped_exposure = 100
        with pytest.raises(DeviceError, match=r"exposure 0.03 s asked for, the camera took 0.01 s"):
            remote.set_exposure_s(0.03)
        assert [steps(frame) for frame in remote.grab(2)] == [20, 20]
        camera.faults.clamped_exposure = None
        assert remote.set_exposure_s(0.03) == 0.03
        assert steps(remote.grab(1)[0]) == 300


def test_a_missing_gain_control_is_an_error(remote: RemoteCamera, scene: LevelScene) -> None:
    with (
        served(remote, scene, without_controls=frozenset({ioctl.GAIN})),
        pytest.raises(DeviceError, match=f"{WHO}: gain 100 asked for, but the camera has no such"),
    ):
        remote.ask("open", SETTINGS)
