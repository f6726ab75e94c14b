"""V4L2 controls: automatic ones are switched off, and every value is read back."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.v4l2 import ioctl
from instrument.config.camera import CameraDefects
from instrument.errors import DeviceError, Interlock
from sim.emulated.v4l2.device import BRIGHTNESS
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
        BRIGHTNESS: 128,
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


def test_an_exposure_that_the_camera_rounds_is_used_as_it_was_read_back(
    remote: RemoteCamera, scene: LevelScene
) -> None:
    """Exposures in factors of two, as of webcams: 60 and 61 ms become 62.5 ms."""
    table = CameraDefects(exposures_s=[0.0156, 0.0312, 0.0625, 0.125], reads_back="taken")
    with served(remote, scene, defects=table):
        remote.ask("open", replace(SETTINGS, min_exposure_s=0.02))
        remote.ask("said")
        for asked_s in (0.06, 0.061, 0.06):
            assert remote.set_exposure_s(asked_s) == 0.0625
            (frame,) = remote.grab(1)
            assert (steps(frame), frame.exposure_s) == (625, 0.0625)
        said = remote.ask("said")
    assert [text.partition(": ")[2] for text in said] == [
        f"exposure {asked_s} s asked for, the camera took 0.0625 s, which is used"
        for asked_s in (0.06, 0.061)
    ]


@pytest.mark.parametrize(
    ("number", "value", "message"),
    [
        (ioctl.EXPOSURE_ABSOLUTE, 77, "exposure is 0.0077 s, but 0.001 s was set"),
        (ioctl.GAIN, 200, "gain is 200, but 100 was set"),
        (ioctl.EXPOSURE_AUTO, 3, "manual exposure, which is mode is 3, but 1 was set"),
        (ioctl.AUTO_WHITE_BALANCE, 1, "automatic white balance is 1, but 0 was set"),
        (BRIGHTNESS, 12, "brightness is 12, but 128 when the camera was opened"),
    ],
)
def test_a_change_by_another_program_is_noticed(
    remote: RemoteCamera, scene: LevelScene, number: int, value: int, message: str
) -> None:
    with served(remote, scene) as camera:
        remote.ask("open", SETTINGS)
        remote.grab(1)
        camera.set_value(number, value)
        with pytest.raises(Interlock, match=f"^camera settings: {WHO}: {message}: another prog"):
            remote.grab(2)
        assert camera.value(number) != value  # it was set back
        assert steps(remote.grab(1)[0]) == 10  # the camera has been set again


def test_a_gain_that_the_rig_file_does_not_name_is_watched_too(
    remote: RemoteCamera, scene: LevelScene
) -> None:
    with served(remote, scene) as camera:
        remote.ask("open", replace(SETTINGS, gain=None))
        assert remote.ask("settings")["gain"] == "100"
        remote.grab(1)
        camera.set_value(ioctl.GAIN, 150)
        with pytest.raises(Interlock, match=r"gain is 150, but 100 when .* and 100 was set again"):
            remote.grab(2)
        remote.grab(2)
        assert camera.gain == 100


def test_a_control_that_the_camera_changes_by_itself_is_left_alone(
    remote: RemoteCamera, scene: LevelScene
) -> None:
    with served(remote, scene) as camera:
        found = camera._controls[BRIGHTNESS]
        camera._controls[BRIGHTNESS] = replace(found, steady=False)
        remote.ask("open", SETTINGS)
        remote.grab(1)
        camera.set_value(BRIGHTNESS, 12)
        assert len(remote.grab(2)) == 2
        assert "brightness" not in remote.ask("settings")


def test_controls_are_read_once_a_series(remote: RemoteCamera, scene: LevelScene) -> None:
    with served(remote, scene) as camera:
        remote.ask("open", SETTINGS)
        before = camera.requests["G_CTRL"]
        remote.grab(8)
        remote.ask("settings")
        assert camera.requests["G_CTRL"] - before == len(camera.controls())


def test_a_missing_gain_control_is_an_error(remote: RemoteCamera, scene: LevelScene) -> None:
    with (
        served(remote, scene, without_controls=frozenset({ioctl.GAIN})),
        pytest.raises(DeviceError, match=f"{WHO}: gain 100 asked for, but the camera has no such"),
    ):
        remote.ask("open", SETTINGS)
