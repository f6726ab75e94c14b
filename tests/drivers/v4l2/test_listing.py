"""List of V4L2 cameras and their capabilities."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers.v4l2.listing import video_devices
from instrument.errors import DeviceError
from tests.support.v4l2.remote_camera import (
    DEVICE,
    LevelScene,
    RemoteCamera,
    served,
)


def test_description_without_a_stream(remote: RemoteCamera, scene: LevelScene) -> None:
    with served(remote, scene, card="Bench camera 7") as camera:
        first, *lines = remote.ask("describe", DEVICE).splitlines()
        assert camera.requests["REQBUFS"] == camera.requests["STREAMON"] == 0
    assert first == f"  {DEVICE}: Bench camera 7 (emulated, platform:emulated-0)"
    sizes = "640 x 480, 512 x 480, 64 x 48"
    assert lines[:4] == [f"    {name}: {sizes}" for name in ("GREY", "Y10", "Y16", "YUYV")]
    assert "    Gain (integer): 100; 0 to 480 in steps of 10" in lines[4:]
    assert len(lines[4:]) == 6


def test_description_of_a_missing_device(remote: RemoteCamera) -> None:
    with pytest.raises(DeviceError, match=r"/dev/video77: does not answer.*No such file"):
        remote.ask("describe", "/dev/video77")


def test_devices_are_listed_by_id_where_there_are_ids(tmp_path: Path) -> None:
    for name in ("video10", "video2", "videodev"):
        (tmp_path / name).touch()
    assert video_devices(tmp_path) == [str(tmp_path / "video2"), str(tmp_path / "video10")]
    by_id = tmp_path / "v4l" / "by-id"
    by_id.mkdir(parents=True)
    (by_id / "usb-maker_camera_7-video-index0").touch()
    assert video_devices(tmp_path) == [str(by_id / "usb-maker_camera_7-video-index0")]
