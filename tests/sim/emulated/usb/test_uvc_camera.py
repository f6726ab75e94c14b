"""UVC camera: negotiation, streaming, controls and faults, through a USB/IP client."""

from __future__ import annotations

import errno
import threading
from itertools import islice
from typing import Any

import pytest
from numpy.typing import NDArray

from drivers.v4l2 import ioctl
from instrument.config.camera import CameraDefects
from sim.emulated.usb.device import Stall
from sim.emulated.usb.uvc_camera import UvcCamera
from sim.emulated.usb.uvc_controls import CONTROLS
from sim.emulated.usb.uvc_descriptors import Probe, interval
from sim.emulated.v4l2.device import EmulatedCamera, Exposure
from tests.support.timing.deadline import DEADLINE_S, wait_for
from tests.support.usb.cameras import QUICK, RATES, Bench, imported_camera, render
from tests.support.usb.uvc_host import UvcFrame, pixels

STEP_S = 1e-4
Y16 = Probe(3, 1, interval(RATES[0]))
MANUAL, BY_APERTURE = 1, 8  # of AE_MODE
MENU = [1, 3]  # the same in V4L2
MOST_ON_THE_WAY = 100  # frames, before a changed exposure must show


def exposures(frames: list[UvcFrame]) -> list[int]:
    """Exposures of Y16 frames, in 100 µs."""
    return [int(pixels(frame, 64, 48, "Y16")[0, 0]) for frame in frames]


def frames_from(bench: Bench, steps: int) -> list[UvcFrame]:
    """Three frames, from the first on that has this exposure.

    Any number of frames may have been on their way when it was set: the host may stand still.
    """
    first = bench.host.frame()
    for _ in range(MOST_ON_THE_WAY):
        if exposures([first]) == [steps]:
            break
        first = bench.host.frame()
    return [first, bench.host.frame(), bench.host.frame()]


@pytest.mark.parametrize("size", [1, 2])
@pytest.mark.parametrize("number", range(1, 5))
def test_every_format_and_size_gives_the_rendered_pixels(number: int, size: int) -> None:
    name, (width, height) = QUICK.formats[number - 1], QUICK.sizes[size - 1]
    with imported_camera() as bench:
        chosen = bench.host.start(Probe(number, size, interval(RATES[0])))
        frames = [bench.host.frame() for _ in range(3)]
        seen = [pixels(frame, width, height, name) for frame in frames]
        assert [len(frame.data) for frame in frames] == [chosen.max_frame_bytes] * 3
    for image in seen:
        exposure = Exposure(157 * STEP_S, 100, 0.0, int(image[0, 2]), name, width, height)
        assert (image == render(exposure, None)).all()
    assert not any(frame.flagged for frame in frames)


def test_a_choice_outside_the_descriptors_becomes_the_nearest() -> None:
    with imported_camera() as bench:
        for asked, expected in (
            (Probe(0, 0, 1), (1, 1, interval(RATES[0]))),
            (Probe(9, 9, 10**9), (4, 2, interval(RATES[2]))),
            (Probe(3, 2, interval(260)), (3, 2, interval(RATES[1]))),
        ):
            assert bench.host.negotiate(asked)[:3] == expected
        assert bench.host.probe("GET_DEF")[:3] == (1, 1, interval(RATES[0]))


def test_a_fault_puts_another_format_in_its_place() -> None:
    with imported_camera() as bench:
        bench.camera.faults.substitute_format = "GREY"
        assert bench.host.negotiate(Y16)[:2] == (1, 1)


def test_the_negotiated_rate_is_kept() -> None:
    with imported_camera() as bench:
        for rate in RATES:
            bench.host.negotiate(Probe(3, 1, interval(rate)))
            assert bench.camera.frame_interval_s == pytest.approx(1 / rate, rel=1e-4)


def test_a_stream_ends_and_begins_again_as_uvcvideo_does_it() -> None:
    with imported_camera() as bench:
        for number, name in ((3, "Y16"), (1, "GREY"), (3, "Y16")):
            bench.host.start(Probe(number, 1, Y16.frame_interval))
            assert pixels(bench.host.frame(), 64, 48, name)[0, 3] == 21
            bench.host.stop()


def test_a_stream_ends_in_the_middle_of_a_frame_that_nobody_takes_further() -> None:
    with imported_camera() as bench:
        bench.host.start(Y16, urbs=1)
        assert len(bench.host.payload(resubmit=False)) == 2
        bench.host.stop()
        bench.host.start(Y16)
        assert bench.host.frame().data


def test_controls_have_the_ranges_of_the_model() -> None:
    with imported_camera(exposure_range=(20, 2047, 1)) as bench:
        known = bench.camera.controls()
        for control in CONTROLS[1:]:
            found = known[control.number]
            requests = ("GET_MIN", "GET_MAX", "GET_RES", "GET_DEF", "GET_CUR")
            answers = [bench.host.get(control.name, request) for request in requests]
            limits = [found.minimum, found.maximum, found.step]
            assert answers == [*limits, found.default, found.value]
            assert bench.host.get(control.name, "GET_LEN") == control.size
            assert bench.host.get(control.name, "GET_INFO") == 3
        assert bench.host.get("EXPOSURE_TIME_ABSOLUTE", "GET_MIN") == 20


def test_missing_controls_are_not_announced_and_stall() -> None:
    with imported_camera(without_controls=frozenset({ioctl.GAIN})) as bench:
        with pytest.raises(Stall):
            bench.host.get("GAIN")
        assert bench.host.last_error() == 6  # invalid control (UVC 1.1, table 4-7)
        assert bench.host.get("BRIGHTNESS") == 128


def test_the_exposure_is_set_in_manual_mode_only() -> None:
    with imported_camera() as bench:
        assert bench.host.get("AE_MODE") == BY_APERTURE
        assert bench.host.get("AE_MODE", "GET_RES") == MANUAL | BY_APERTURE
        with pytest.raises(Stall):
            bench.host.set("EXPOSURE_TIME_ABSOLUTE", 50)
        assert bench.host.last_error() == 2  # wrong state
        for mode, menu in zip((MANUAL, BY_APERTURE), MENU, strict=True):
            bench.host.set("AE_MODE", mode)
            assert bench.camera.value(ioctl.EXPOSURE_AUTO) == menu
        for unsupported in (0, 2, 3, 4, 255):
            with pytest.raises(Stall):
                bench.host.set("AE_MODE", unsupported)
            assert bench.host.last_error() == 4  # out of range


def test_exposure_and_gain_reach_the_picture() -> None:
    with imported_camera(delay_frames=1) as bench:
        bench.host.set("AE_MODE", MANUAL)
        bench.host.set("GAIN", 240)
        bench.host.start(Y16)
        for steps in (3, 40, 11):
            bench.host.set("EXPOSURE_TIME_ABSOLUTE", steps)
            frames = frames_from(bench, steps)
            assert exposures(frames) == [steps] * 3
            assert pixels(frames[0], 64, 48, "Y16")[0, 1] == 240


@pytest.mark.real_time
def test_a_sensor_delay_shows_in_the_frames() -> None:
    """Of the frames after a change, exactly those in the pipeline have the exposure before it."""
    with imported_camera(delay_frames=5) as bench:
        bench.host.set("AE_MODE", MANUAL)
        bench.host.set("EXPOSURE_TIME_ABSOLUTE", 9)
        bench.host.start(Y16._replace(frame_interval=interval(RATES[2])))
        bench.host.set("EXPOSURE_TIME_ABSOLUTE", 33)
        seen = exposures([bench.host.frame() for _ in range(10)])
        assert seen == sorted(seen)
        assert 5 <= seen.count(9) <= 7  # and those exposed during the requests


@pytest.mark.parametrize(
    ("defects", "sensor"),
    [
        ({"exposures_s": [0.0008, 0.0016, 0.0032]}, 16),  # rounded
        ({"longest_exposure_s": 0.0009}, 9),  # clamped
        ({"fixed_exposure_s": 0.0021}, 21),  # ignored
    ],
)
def test_another_exposure_than_the_one_that_reads_back(
    defects: dict[str, object], sensor: int
) -> None:
    with imported_camera(defects=CameraDefects.model_validate(defects)) as bench:
        bench.host.set("AE_MODE", MANUAL)
        bench.host.start(Y16)
        bench.host.set("EXPOSURE_TIME_ABSOLUTE", 18)
        assert bench.host.get("EXPOSURE_TIME_ABSOLUTE") == 18
        assert exposures(frames_from(bench, sensor)) == [sensor] * 3


def test_a_stuck_control_keeps_its_value() -> None:
    with imported_camera() as bench:
        bench.camera.faults.stuck_controls.add(ioctl.GAIN)
        bench.host.set("GAIN", 200)
        assert bench.host.get("GAIN") == 100


def test_requests_stall_as_often_as_told() -> None:
    with imported_camera() as bench:
        host, faults = bench.host, bench.camera.faults
        faults.fail("SET_CUR GAIN", times=2)
        host.set("BRIGHTNESS", 100)  # another control is not concerned
        for _ in range(2):
            with pytest.raises(Stall):
                host.set("GAIN", 200)
            assert host.last_error() == 0xFF  # unknown
        assert host.get("GAIN") == 100
        host.set("GAIN", 200)
        assert host.get("GAIN") == 200
        faults.fail("SET_CUR")
        with pytest.raises(Stall):
            host.set("BRIGHTNESS", 7)
        faults.fail("GET_CUR", errno.EIO)
        with pytest.raises(Stall):
            host.get("BRIGHTNESS")
        assert host.get("BRIGHTNESS") == 100
        faults.fail("SET_CUR COMMIT")
        with pytest.raises(Stall):
            host.negotiate(Y16)


def test_flagged_and_short_frames_are_marked_in_the_payloads() -> None:
    with imported_camera() as bench:
        chosen = bench.host.start(Y16)
        bench.host.frame()
        bench.camera.faults.bad_frames.extend(["flagged", "short", "flagged"])
        frames = [bench.host.frame() for _ in range(6)]
    whole = chosen.max_frame_bytes
    odd = [f for f in frames if f.flagged or len(f.data) != whole]
    assert [(f.flagged, len(f.data)) for f in odd] == [
        (True, whole),
        (False, whole // 2),
        (True, whole),
    ]


def test_a_frame_begins_before_its_picture_is_rendered() -> None:
    """Its first payload, by which uvcvideo stamps it, comes at the end of the exposure."""
    rendering, finished = threading.Event(), threading.Event()

    def render_slowly(exposure: Exposure, seen: object) -> NDArray[Any]:
        rendering.set()
        assert finished.wait(DEADLINE_S)
        return render(exposure, seen)

    with imported_camera() as bench:
        bench.camera.render = render_slowly
        bench.host.start(Y16)
        assert len(bench.host.payload()) == 2
        assert rendering.wait(DEADLINE_S)
        finished.set()
        assert len(bench.host.frame().data) == 64 * 48 * 2


def test_a_frame_that_would_get_too_late_a_stamp_is_lost() -> None:
    """As on a machine that does not keep up: here the scene takes longer than the exposure."""
    seen = iter((0.05, 0.05))
    with imported_camera() as bench:
        bench.camera.snapshot = lambda: threading.Event().wait(next(seen, 0.0))
        bench.host.start(Y16)
        assert pixels(bench.host.frame(), 64, 48, "Y16")[0, 2] >= 2


def test_rates_above_the_models_limit_are_refused() -> None:
    camera = EmulatedCamera(render, capabilities=QUICK)
    for rates in ((), (501, 100)):
        with pytest.raises(ValueError, match="none above the model's 500/s"):
            UvcCamera(camera, rates)


def test_a_frozen_stream_gives_nothing_until_it_thaws() -> None:
    with imported_camera() as bench:
        bench.camera.faults.frozen = True
        bench.host.start(Y16)
        wait_for(lambda: bench.exposed >= 3, "three exposures")
        assert bench.host.get("GAIN") == 100  # requests are answered all the while
        bench.camera.faults.frozen = False
        assert pixels(bench.host.frame(), 64, 48, "Y16")[0, 2] >= 2  # the others are lost


def test_unplugging_the_model_pulls_the_cable_in_mid_stream() -> None:
    with imported_camera() as bench:
        bench.host.start(Y16)
        bench.host.frame()
        bench.camera.unplug()
        with pytest.raises((EOFError, OSError)):
            list(islice(iter(bench.host.frame, None), 1000))
