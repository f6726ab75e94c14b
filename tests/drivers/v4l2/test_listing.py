"""List of V4L2 cameras and their capabilities."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from drivers.v4l2 import ioctl
from drivers.v4l2.listing import video_devices
from drivers.v4l2.open_device import require_pictures
from instrument.errors import CameraLost, DeviceError
from tests.support.v4l2.remote_camera import (
    DEVICE,
    SETTINGS,
    WHO,
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
    assert len(lines[4:]) == len(camera.controls())


def test_description_of_a_missing_device(remote: RemoteCamera) -> None:
    with pytest.raises(DeviceError, match=r"/dev/video77: does not answer.*No such file"):
        remote.ask("describe", "/dev/video77")


def test_cameras_without_an_id_are_listed_after_those_with_one(tmp_path: Path) -> None:
    for name in ("video10", "video2", "video3", "videodev"):
        (tmp_path / name).touch()
    assert video_devices(tmp_path) == [str(tmp_path / f"video{n}") for n in (2, 3, 10)]
    by_id = tmp_path / "v4l" / "by-id"
    by_id.mkdir(parents=True)
    links = [by_id / f"usb-maker_camera_7-video-index{n}" for n in (0, 1)]
    for link, node in zip(links, ("video2", "video3"), strict=True):
        link.symlink_to(tmp_path / node)
    gone = by_id / "usb-maker_unplugged-video-index0"
    gone.symlink_to(tmp_path / "video99")
    assert video_devices(tmp_path) == [*map(str, links), str(gone), str(tmp_path / "video10")]


def test_a_node_for_metadata_is_left_out_and_no_odd_device_ends_the_list(
    remote: RemoteCamera, scene: LevelScene
) -> None:
    """/dev/null opens, and is no V4L2 device."""
    with served(remote, scene):
        odd, camera, missing = remote.ask("descriptions", "/dev/null", DEVICE, "/dev/video77")
    assert odd.startswith("  /dev/null: FAILED: camera /dev/null: does not answer as a V4L2")
    assert camera.startswith(f"  {DEVICE}: Emulated camera")
    assert "No such file" in missing
    with served(remote, scene, node=ioctl.METADATA):
        assert remote.ask("descriptions", DEVICE, "/dev/null") == [odd]
    with served(remote, scene, node=ioctl.MULTI_PLANAR):
        (planes,) = remote.ask("descriptions", DEVICE)
    assert "several planes, which this program cannot use" in planes.splitlines()[0]


def test_cameras_for_pictures_are_found_with_formats_exposure_and_gain(
    remote: RemoteCamera, scene: LevelScene
) -> None:
    with served(remote, scene, formats=("YUYV", "GREY")) as camera:
        (found,) = remote.ask("found_cameras", "/dev/null", DEVICE, "/dev/video77")
        assert camera.requests["S_FMT"] == camera.requests["S_CTRL"] == 0  # nothing is changed
    assert dict(found.formats)["GREY"] == ("640 x 480", "512 x 480", "64 x 48")
    assert (found.exposure.minimum, found.exposure.maximum) == (1, 100_000)
    assert (found.gain.value, found.gain.step) == (100, 10)
    with served(remote, scene, node=ioctl.MULTI_PLANAR):
        assert remote.ask("found_cameras", DEVICE) == []


@pytest.mark.parametrize(
    ("formats", "quantization", "limited"),
    [
        (("YUYV",), ioctl.FULL_RANGE, False),
        (("YUYV",), ioctl.LIMITED_RANGE, True),
        (("YUYV",), ioctl.DEFAULT_RANGE, True),  # the rule of linux/videodev2.h
        (("GREY",), ioctl.FULL_RANGE, None),
    ],
)
def test_the_range_of_yuyv_is_read(
    formats: tuple[str, ...],
    quantization: int,
    limited: bool | None,
    remote: RemoteCamera,
    scene: LevelScene,
) -> None:
    with served(remote, scene, formats=formats, quantization=quantization):
        (found,) = remote.ask("found_cameras", DEVICE)
    assert found.limited_range is limited


def test_a_big_endian_format_is_listed(remote: RemoteCamera, scene: LevelScene) -> None:
    with served(remote, scene, big_endian=True, formats=("Y16", "GREY")):
        _, *lines = remote.ask("describe", DEVICE).splitlines()
    assert [line.split(":")[0].strip() for line in lines[:2]] == ["Y16 -BE", "GREY-BE"]


@given(st.integers(0, 2**32 - 1))
@example(ioctl.fourcc("Y16") | 1 << 31)
@example(0xFFFFFFFF)
def test_every_pixel_format_has_a_name_from_which_its_number_follows(number: int) -> None:
    name = ioctl.fourcc_name(number)
    assert name.isascii()
    assert ioctl.fourcc(name) == number


@pytest.mark.parametrize(
    ("index", "advice"),
    [(1, "name .*-camera-video-index0 in"), (3, "name one that `gonio devices` lists in")],
)
def test_a_rig_that_names_a_node_for_metadata_is_told_so(index: int, advice: str) -> None:
    device = f"/dev/v4l/by-id/usb-emulated-camera-video-index{index}"
    node = ioctl.Capability("uvcvideo", "Webcam", "usb-1", ioctl.METADATA)
    with pytest.raises(DeviceError, match=f"is for metadata, not for pictures; {advice}") as caught:
        require_pictures(node, device, f"camera Webcam ({device})")
    assert not isinstance(caught.value, CameraLost)  # it is not tried again


def test_a_node_for_metadata_is_not_opened(remote: RemoteCamera, scene: LevelScene) -> None:
    with (
        served(remote, scene, node=ioctl.METADATA),
        pytest.raises(DeviceError, match=f"{WHO}: this node is for metadata, not for pictures"),
    ):
        remote.ask("open", SETTINGS)
