"""The camera behind uvcvideo: formats, exposures, faults, unplugging."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from acquisition.engine.retrying_camera import RetryingCamera
from drivers.discovery import cameras
from drivers.factory import open_camera
from drivers.v4l2 import ioctl
from drivers.v4l2.camera import V4l2Camera
from drivers.v4l2.settings import V4l2Settings
from instrument.clock import SystemClock
from instrument.config.camera import V4l2CameraConfig
from instrument.config.load import load_rig
from instrument.devices import Frame
from instrument.errors import CameraLost, DeviceError
from tests.hil_emulated.guest.devices import CAMERA, METADATA, plug_in, wait_for_node
from tests.hil_emulated.link import Bench
from tests.support.v4l2.camera_contract import CHECKS

pytestmark = pytest.mark.hil

SETTINGS = V4l2Settings(
    device=CAMERA, pixel_format="Y16", width_px=160, height_px=128, bit_depth=16,
    min_exposure_s=0.001, max_exposure_s=0.05, exposure_delay_frames=0, frames_per_s=20,
)  # fmt: skip
EXPOSURES_S = (0.002, 0.0254, 0.001, 0.0255, 0.002)
NODROP = Path("/sys/module/uvcvideo/parameters/nodrop")


@contextmanager
def opened(settings: V4l2Settings = SETTINGS) -> Iterator[V4l2Camera]:
    with V4l2Camera(settings, SystemClock()) as one:
        yield one


def exposure_s(frame: Frame) -> float:
    """Exposure that the sensor used, which the image tells."""
    return int(frame.image[0, 0]) / 10_000


def gain(frame: Frame) -> int:
    return int(frame.image[0, 1])


def assert_frames_have_their_exposures(camera: V4l2Camera, count: int = 3) -> None:
    for asked_s in EXPOSURES_S:
        camera.set_exposure_s(asked_s)
        called_s = time.monotonic()
        for frame in camera.grab(count):
            assert exposure_s(frame) == pytest.approx(asked_s)
            assert frame.exposure_s == pytest.approx(asked_s)
            assert frame.device_time_s is not None
            assert frame.device_time_s > called_s


@pytest.mark.parametrize(
    "settings",
    [
        SETTINGS,
        replace(SETTINGS, pixel_format="GREY", bit_depth=8),
        replace(SETTINGS, pixel_format="YUYV", bit_depth=8, limited_range=True),
        replace(SETTINGS, width_px=320, height_px=240, gain=100),
    ],
    ids=["Y16", "GREY", "YUYV", "Y16 with gain"],
)
def test_every_frame_has_the_exposure_that_was_set(camera: Bench, settings: V4l2Settings) -> None:
    with opened(settings) as one:
        assert_frames_have_their_exposures(one)
        frame = one.grab(1)[0]
        assert frame.image.shape == (settings.height_px, settings.width_px)
        assert settings.gain in (None, gain(frame))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"pixel_format": "Y10", "bit_depth": 10}, "Y10"),
        ({"width_px": 600}, "600 x 128"),
        ({"max_exposure_s": 20.0}, "exposure 20 s asked for"),
        ({"gain": 105}, "gain 105 asked for"),
        ({"gain": 1000}, "gain 1000 asked for"),
        ({"frames_per_s": 100}, "100 frames a second asked for"),
        ({"device": METADATA}, "metadata"),
        ({"device": "/dev/v4l/by-id/none"}, "No such file"),
    ],
    ids=["format", "size", "exposure", "step of gain", "gain", "rate", "metadata", "nobody"],
)
def test_a_setting_that_the_camera_does_not_have_is_refused(
    camera: Bench, changes: dict[str, object], message: str
) -> None:
    os.close(os.open(CAMERA, os.O_RDWR))  # it is there
    with pytest.raises(DeviceError, match=message), opened(replace(SETTINGS, **changes)):  # type: ignore[arg-type]  # of the tuples above
        pass


def test_a_camera_is_listed_once_and_without_its_metadata(camera: Bench) -> None:
    text = "\n".join(cameras())
    assert text.count(CAMERA) == 1
    assert METADATA not in text
    assert "Y16: 160 x 128" in text
    assert "Exposure Time, Absolute" in text


def test_an_exposure_rounded_in_silence_is_noticed_by_its_light(camera: Bench) -> None:
    """uvcvideo answers from its cache: the read-back is what was set."""
    camera.show("surface")
    camera.defects(exposures_s=[0.0016 * n for n in range(1, 40)])
    config = load_rig(Path(__file__).parents[1] / "rig.yaml").camera
    assert isinstance(config, V4l2CameraConfig)
    with open_camera(config, CAMERA, SystemClock()) as one:  # type: ignore[attr-defined]  # V4l2Camera
        assert one.set_exposure_s(0.005) == pytest.approx(0.005)
        with pytest.raises(AssertionError, match="counts are not proportional"):
            CHECKS["linearity"](one, config)


def test_an_exposure_set_by_another_program_ends_the_series(camera: Bench) -> None:
    with opened() as one:
        one.set_exposure_s(0.001)
        with ioctl.opened(CAMERA) as other:
            ioctl.set_control(other, ioctl.EXPOSURE_ABSOLUTE, 77)
        with pytest.raises(DeviceError, match=r"exposure is 0.0077 s, but 0.001 s was set"):
            one.grab(2)


@pytest.mark.parametrize("frames", [2, 4])
def test_a_sensor_that_is_late_is_waited_for(camera: Bench, frames: int) -> None:
    camera.defects(delay_frames=frames)
    with opened(replace(SETTINGS, exposure_delay_frames=frames)) as one:
        assert_frames_have_their_exposures(one, count=2)


def test_a_stalled_control_is_named_and_can_be_set_again(camera: Bench) -> None:
    with opened() as one:
        camera.stall(1)
        with pytest.raises(DeviceError, match=r"exposure 0.003 s asked for; the camera refused it"):
            one.set_exposure_s(0.003)
        one.set_exposure_s(0.004)
        assert exposure_s(one.grab(1)[0]) == pytest.approx(0.004)


def test_a_frozen_stream_is_named_and_goes_on_later(camera: Bench) -> None:
    with opened() as one:
        one.grab(1)
        camera.fault(frozen=True)
        with pytest.raises(CameraLost, match="no frame"):
            one.grab(6)
        camera.fault(frozen=False)
        assert len(one.grab(2)) == 2


@pytest.mark.parametrize("kind", ["flagged", "short"])
@pytest.mark.parametrize("nodrop", ["0", "1"])
def test_a_bad_frame_is_taken_again(camera: Bench, kind: str, nodrop: str) -> None:
    """With nodrop=0 the kernel drops it, with nodrop=1 it hands it over with its flag."""
    before = NODROP.read_text()
    NODROP.write_text(nodrop)
    try:
        with opened() as one:
            one.grab(1)
            camera.bad_frames(kind, kind)
            assert all(exposure_s(f) == pytest.approx(0.001) for f in one.grab(6))
    finally:
        NODROP.write_text(before)


def pulled_after(bench: Bench, seconds: float) -> threading.Timer:
    timer = threading.Timer(seconds, bench.unplug, ["1-1"])
    timer.start()
    return timer


def test_a_camera_that_is_plugged_in_again_has_its_settings(camera: Bench) -> None:
    """It may return as another node: an open descriptor keeps the first name occupied."""
    with opened(replace(SETTINGS, gain=100)) as one:
        one.set_exposure_s(0.004)
        one.grab(1)
        node = os.path.realpath(CAMERA)
        held = os.open(node, os.O_RDWR)
        try:
            timer = pulled_after(camera, 0.5)
            with pytest.raises(CameraLost):
                one.grab(300)
            timer.join()
            wait_for_node(CAMERA, there=False)
            with pytest.raises(CameraLost):
                one.grab(1)
            plug_in("1-1")
            assert wait_for_node(CAMERA) != node
            frame = one.grab(1)[0]
            assert (exposure_s(frame), gain(frame)) == (pytest.approx(0.004), 100)
        finally:
            os.close(held)


def test_a_camera_is_waited_for_with_one_message_each_way(
    camera: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    with opened() as one:
        patient = RetryingCamera(one, SystemClock(), 60.0, lambda: None)
        patient.set_exposure_s(0.004)
        pulled_after(camera, 0.5)
        replug = threading.Timer(6.0, plug_in, ["1-1"])
        replug.start()
        frames = patient.grab(40)
        replug.join()
        assert all(exposure_s(f) == pytest.approx(0.004) for f in frames)
        assert patient.waited_s > 4
    told = [r.getMessage() for r in caplog.records if r.name.startswith("acquisition")]
    assert ["waiting for it" in told[0], "back after" in told[1], len(told)] == [True, True, 2]
