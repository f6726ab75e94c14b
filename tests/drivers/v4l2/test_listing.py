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
        found = remote.ask("describe", DEVICE)
        assert camera.requests["REQBUFS"] == camera.requests["STREAMON"] == 0
    assert (found.device, found.capability.card) == (DEVICE, "Bench camera 7")
    assert [one.name for one in found.formats] == ["GREY", "Y10", "Y16", "YUYV"]
    assert found.formats[2].sizes == ("640 x 480", "512 x 480", "64 x 48")
    assert (found.current.name, found.current.width_px) == ("GREY", 640)
    gain = next(one for one in found.controls if one.name == "Gain")
    assert (gain.minimum, gain.maximum, gain.step, gain.value) == (0, 480, 10, 100)
    assert len(found.controls) == 6


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
