"""The kernel's own test camera, vivid: formats and errors of a driver that we have not written.

vivid has no exposure: its control "Integer 32 Bits" stands in for it.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from drivers.discovery import cameras
from drivers.v4l2 import capture, ioctl
from drivers.v4l2.camera import V4l2Camera
from drivers.v4l2.settings import V4l2Settings
from instrument.clock import SystemClock
from instrument.errors import CameraLost, DeviceError
from tests.hil_emulated.guest.devices import wait_until

pytestmark = pytest.mark.hil

_OPTIONS = "n_devs=1 node_types=0x1 num_inputs=1 input_types=0x0 ccs_cap_mode=7 vid_cap_nr=9"
DEVICE = "/dev/video9"
SETTINGS = V4l2Settings(
    device=DEVICE, pixel_format="Y16", width_px=640, height_px=360, bit_depth=16,
    min_exposure_s=0.001, max_exposure_s=0.1, exposure_delay_frames=0,
)  # fmt: skip
WHITE, FULL_RANGE_GREY = 6, 254  # number of the pattern; vivid's 100 % white


@pytest.fixture
def vivid(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    subprocess.run(["insmod", "/modules/vivid.ko", *_OPTIONS.split()], check=True)
    try:
        wait_until(Path(DEVICE).exists, DEVICE)
        subprocess.run(["udevadm", "settle"], check=True)
        stand_in = replace(capture.EXPOSURE, number=number_of("Integer 32 Bits"))
        monkeypatch.setattr(capture, "EXPOSURE", stand_in)
        yield
    finally:
        wait_until(lambda: subprocess.run(["rmmod", "vivid"], check=False).returncode == 0, "rmmod")


def number_of(name: str) -> int:
    with ioctl.opened(DEVICE) as descriptor:
        return next(c.number for c in ioctl.controls(descriptor) if c.name == name)


def set_control(name: str, value: int = 1) -> None:
    number = number_of(name)
    with ioctl.opened(DEVICE) as descriptor:
        ioctl.set_control(descriptor, number, value)


@pytest.mark.parametrize(
    "settings",
    [
        replace(SETTINGS, pixel_format="GREY", bit_depth=8),
        replace(SETTINGS, pixel_format="Y10", bit_depth=10),
        SETTINGS,
    ],
    ids=["GREY", "Y10", "Y16"],
)
def test_a_format_is_taken_as_it_is(vivid: None, settings: V4l2Settings) -> None:
    set_control("Test Pattern", WHITE)
    with V4l2Camera(settings, SystemClock()) as camera:
        image = camera.grab(2)[1].image
    assert image.shape == (360, 640)
    assert image.max() / (2**settings.bit_depth - 1) == pytest.approx(
        FULL_RANGE_GREY / 255, abs=0.01
    )


def test_white_of_a_limited_range_is_full_scale_only_if_the_rig_file_says_so(vivid: None) -> None:
    """vivid's YUYV is of limited range and says so: white is 235 and not 255."""
    set_control("Test Pattern", WHITE)
    yuyv = replace(SETTINGS, pixel_format="YUYV", bit_depth=8)
    with pytest.raises(DeviceError, match=r"its YUYV has limited range: .* white 235"):
        V4l2Camera(yuyv, SystemClock())
    with V4l2Camera(replace(yuyv, limited_range=True), SystemClock()) as camera:
        assert int(camera.grab(2)[1].image.max()) in (234, 235)


def test_counts_beyond_the_bit_depth_are_refused(vivid: None) -> None:
    """vivid's Y16 is left-aligned, so its counts are not those of a 12-bit sensor."""
    with (
        V4l2Camera(replace(SETTINGS, bit_depth=12), SystemClock()) as camera,
        pytest.raises(DeviceError, match="12 bit"),
    ):
        camera.grab(1)


def test_a_big_endian_format_is_listed(vivid: None) -> None:
    text = "\n".join(cameras())
    assert "Y16 -BE" in text
    assert DEVICE in text


ERRORS = {
    "Inject V4L2_BUF_FLAG_ERROR": False,
    "Inject VIDIOC_QBUF Error": False,
    "Inject VIDIOC_STREAMON Error": False,
    "Inject VIDIOC_REQBUFS Error": False,
    "Inject Fatal Streaming Error": True,
}


@pytest.mark.parametrize("name", ERRORS)
def test_an_error_of_the_driver_is_survived(vivid: None, name: str) -> None:
    with V4l2Camera(SETTINGS, SystemClock()) as camera:
        camera.grab(2)
        set_control(name)
        try:
            frames = camera.grab(4)
        except CameraLost:
            assert ERRORS[name]
            frames = camera.grab(4)
        assert len(frames) == 4


def test_dropped_buffers_cost_only_time(vivid: None) -> None:
    set_control("Percentage of Dropped Buffers", 60)  # later it would be another program's change
    with V4l2Camera(SETTINGS, SystemClock()) as camera:
        assert len(camera.grab(4)) == 4


def test_a_disconnected_camera_is_named(vivid: None) -> None:
    with V4l2Camera(SETTINGS, SystemClock()) as camera:
        camera.grab(1)
        set_control("Disconnect")
        with pytest.raises(CameraLost, match=f"camera vivid .{DEVICE}.*look at"):
            camera.grab(2)
