"""V4L2 session: time stamps of another clock."""

from __future__ import annotations

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
