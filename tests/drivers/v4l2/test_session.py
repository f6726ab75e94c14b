"""V4L2 session: time stamps of another clock, numbers of frames."""

from __future__ import annotations

import pytest

from acquisition.interlocks.watched_camera import WatchedCamera
from instrument.devices import Frame
from instrument.errors import CameraLost, Interlock
from tests.support.synthetic_frames import RIGS
from tests.support.v4l2.remote_camera import (
    SETTINGS,
    LevelScene,
    RemoteCamera,
    level,
    served,
    steps,
)


def test_stamps_of_another_clock(remote: RemoteCamera, scene: LevelScene) -> None:
    """Frames are counted then, and the identity says so."""
    with served(remote, scene, stamp_offset_s=1.7e9):
        assert "another clock: 6 frames dropped" in remote.ask("open", SETTINGS)
        for change in range(1, 6):
            scene.level = change
            frames = remote.grab(2)
            assert [level(frame) for frame in frames] == [change, change]
            assert frames[0].device_time_s is None
        remote.set_exposure_s(0.02)
        assert [steps(frame) for frame in remote.grab(2)] == [200, 200]


def test_frames_have_the_numbers_of_their_buffers(remote: RemoteCamera, scene: LevelScene) -> None:
    """They rise from series to series, with gaps, and begin anew when the camera is reopened."""
    with served(remote, scene) as camera:
        remote.ask("open", SETTINGS)
        frames = [frame for _ in range(4) for frame in remote.grab(3)]
        assert [f.sequence for f in frames] == [scene.exposure_of(f).sequence for f in frames]
        numbers = [f.sequence for f in frames if f.sequence is not None]
        assert numbers == sorted(set(numbers))
        assert len(numbers) == 12
        assert numbers[-1] > numbers[0] + 11  # old frames are dropped before each series
        camera.unplug()
        with pytest.raises(CameraLost):
            remote.grab(1)
        camera.replug()
        again = remote.grab(1)[0].sequence
        assert again is not None
        assert again < numbers[-1]


def test_a_camera_opened_on_a_busy_computer_still_numbers_its_frames(
    remote: RemoteCamera, scene: LevelScene
) -> None:
    """Old frames wait in all its buffers, among them that of the first frame, filled again."""
    with served(remote, scene):
        remote.ask("open_late", SETTINGS)
        frames = remote.grab(2)
        assert [f.sequence for f in frames] == [scene.exposure_of(f).sequence for f in frames]
        assert remote.ask("settings")["frame numbers"] == "by the driver"
        assert remote.ask("said") == []


def test_frames_without_numbers_have_none(remote: RemoteCamera, scene: LevelScene) -> None:
    with served(remote, scene, reports_filled=False):
        remote.ask("open", SETTINGS)
        assert [frame.sequence for frame in remote.grab(2)] == [None, None]
        assert remote.ask("settings")["frame numbers"] == "none"


def test_a_buffer_that_is_handed_out_again_ends_a_scan(
    remote: RemoteCamera, scene: LevelScene
) -> None:
    config = RIGS[12].camera.model_copy(update={"bit_depth": 16})
    with served(remote, scene) as camera:
        remote.ask("open", SETTINGS)
        watched = WatchedCamera(DrivenCamera(remote), config)  # type: ignore[arg-type]  # a part
        watched.expect({})
        assert len({f.sequence for _ in range(3) for f in watched.grab(4)}) == 12
        camera.faults.repeats = True
        with pytest.raises(Interlock, match=r"^frame order: frame . of 4 has the camera's"):
            watched.grab(4)


class DrivenCamera:
    """The driver of the child process, as a scan uses it."""

    def __init__(self, remote: RemoteCamera) -> None:
        self._remote = remote

    def grab(self, count: int) -> list[Frame]:
        return self._remote.grab(count)

    def settings(self) -> dict[str, str]:
        return dict(self._remote.ask("settings"))
