"""The V4L2 camera when things go wrong: every fault is named, and what can heal heals."""

from __future__ import annotations

import errno
import re
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.v4l2 import ioctl
from instrument.errors import DeviceError
from sim.emulated.v4l2.device import EmulatedCamera, Exposure
from tests.support.v4l2.remote_camera import (
    DEVICE,
    SETTINGS,
    Bench,
    RemoteCamera,
    level,
    served,
    steps,
    wait_for,
)

WHO = re.escape(f"camera Emulated camera ({DEVICE})")
FOUND_WITHIN_S = 2.0  # beyond the exposure


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_a_clamped_exposure_is_an_error_and_the_next_call_sets_what_was_asked(
    remote: RemoteCamera, bench: Bench
) -> None:
    with served(remote, bench) as camera:
        remote.ask("open", SETTINGS)
        remote.set_exposure_s(0.002)
        camera.faults.clamped_exposure = 100
        with pytest.raises(DeviceError, match=r"exposure 0.03 s asked for, the camera took 0.01 s"):
            remote.set_exposure_s(0.03)
        assert [steps(frame) for frame in remote.grab(2)] == [20, 20]
        camera.faults.clamped_exposure = None
        assert remote.set_exposure_s(0.03) == 0.03
        assert steps(remote.grab(1)[0]) == 300


@pytest.mark.parametrize("exposure_s", [0.001, 0.5])
@pytest.mark.parametrize(
    ("strike", "message"),
    [
        (EmulatedCamera.unplug, r"is gone \(No such device\), unplugged.*USB cable"),
        (lambda camera: setattr(camera.faults, "frozen", True), "stands still.*USB cable"),
    ],
    ids=["unplugged", "frozen"],
)
def test_a_lost_camera_is_found_and_named(
    remote: RemoteCamera,
    bench: Bench,
    strike: Callable[[EmulatedCamera], None],
    message: str,
    exposure_s: float,
) -> None:
    """Measured: unplugged within 2 ms, frozen at the exposure and 1.01 s."""
    with served(remote, bench) as camera:
        remote.ask("open", SETTINGS)
        remote.set_exposure_s(exposure_s)
        remote.begin("grab", 100_000)
        bench.wait_exposures(3)
        strike(camera)
        start_s = time.monotonic()
        with pytest.raises(DeviceError, match=f"{WHO}: .*{message}"):
            remote.answer()
        assert time.monotonic() - start_s < exposure_s + FOUND_WITHIN_S


def test_a_camera_plugged_in_again_is_set_as_before(remote: RemoteCamera, bench: Bench) -> None:
    with served(remote, bench) as camera:
        remote.ask("open", SETTINGS)
        remote.set_exposure_s(0.0077)
        camera.unplug()
        with pytest.raises(DeviceError, match="is gone"):
            remote.grab(1)
        camera.replug()
        assert camera.value(ioctl.GAIN) == 100
        assert camera.value(ioctl.EXPOSURE_AUTO) == 3
        bench.level = 5
        frames = remote.grab(3)
        assert [(level(frame), steps(frame)) for frame in frames] == [(5, 77)] * 3
        assert camera.value(ioctl.EXPOSURE_AUTO) == 1
        assert (camera.pixel_format, camera.size) == ("Y16", (64, 48))


def test_a_camera_that_comes_back_while_it_is_looked_for(
    remote: RemoteCamera, bench: Bench
) -> None:
    with served(remote, bench) as camera:
        remote.ask("open", SETTINGS)
        camera.unplug()
        with pytest.raises(DeviceError, match="is gone"):
            remote.set_exposure_s(0.005)
        tries = camera.requests["open"]
        remote.begin("set_exposure_s", 0.005)
        wait_for(lambda: camera.requests["open"] >= tries + 3, "three tries to open")
        camera.replug()
        assert remote.answer() == 0.005
        assert steps(remote.grab(1)[0]) == 50


def test_a_camera_that_stays_away(remote: RemoteCamera, bench: Bench) -> None:
    with served(remote, bench) as camera:
        remote.ask("open", SETTINGS)
        camera.unplug()
        with pytest.raises(DeviceError, match="is gone"):
            remote.grab(1)
        tries = camera.requests["open"]
        start_s = time.monotonic()
        with pytest.raises(DeviceError, match=r"cannot be opened .* \(still so after 2 s\)"):
            remote.grab(1)
        assert time.monotonic() - start_s < 2.5
        assert 4 <= camera.requests["open"] - tries <= 6  # at 0, 0.1, 0.3, 0.7, 1.5 s


def test_another_camera_in_its_place(remote: RemoteCamera, bench: Bench) -> None:
    with served(remote, bench) as camera:
        remote.ask("open", SETTINGS)
        camera.unplug()
        with pytest.raises(DeviceError, match="is gone"):
            remote.grab(1)
        camera.capabilities = replace(camera.capabilities, card="A webcam")
        camera.replug()
        with pytest.raises(DeviceError, match="A webcam answers where Emulated camera did"):
            remote.grab(1)


def test_settings_are_verified_again_after_the_camera_was_lost(
    remote: RemoteCamera, bench: Bench
) -> None:
    with served(remote, bench) as camera:
        remote.ask("open", SETTINGS)
        camera.unplug()
        with pytest.raises(DeviceError, match="is gone"):
            remote.grab(1)
        camera.replug()
        camera.faults.stuck_controls.add(ioctl.EXPOSURE_AUTO)
        with pytest.raises(DeviceError, match="manual exposure"):
            remote.grab(1)
        camera.faults.stuck_controls.clear()
        assert steps(remote.grab(1)[0]) == 10


def test_nothing_is_left_open(remote: RemoteCamera, bench: Bench) -> None:
    """Whether an opening fails early or late, and when a camera was lost."""
    with served(remote, bench) as camera:
        remote.ask("open", SETTINGS)
        remote.ask("close")
        before = remote.ask("held")
        for _ in range(3):
            for wrong in (replace(SETTINGS, gain=105), replace(SETTINGS, frames_per_s=400)):
                with pytest.raises(DeviceError):
                    remote.ask("open", wrong)
            remote.ask("open", SETTINGS)
            camera.unplug()
            with pytest.raises(DeviceError, match="is gone"):
                remote.grab(1)
            camera.replug()
            remote.grab(1)
            remote.ask("close")
        wait_for(lambda: remote.ask("held") == before, f"{before} descriptors and threads")


def test_a_frozen_stream_runs_again(remote: RemoteCamera, bench: Bench) -> None:
    with served(remote, bench) as camera:
        remote.ask("open", SETTINGS)
        camera.faults.frozen = True
        with pytest.raises(DeviceError, match="stands still"):
            remote.grab(1)
        camera.faults.frozen = False
        bench.level = 9
        assert [level(frame) for frame in remote.grab(2)] == [9, 9]


@pytest.mark.parametrize("request_name", ["DQBUF", "QBUF", "QUERYBUF"])
@pytest.mark.parametrize("error", [errno.EIO, errno.EINVAL])
def test_one_failed_request_heals_by_itself(
    remote: RemoteCamera, bench: Bench, request_name: str, error: int
) -> None:
    with served(remote, bench) as camera:
        remote.ask("open", SETTINGS)
        for change in range(1, 4):
            bench.level = change
            camera.faults.fail(request_name, error)
            assert [level(frame) for frame in remote.grab(6)] == [change] * 6
            assert not camera.faults.failing[request_name]
            if request_name == "QBUF":
                remote.ask("open", SETTINGS)  # each one costs the stream a buffer
        assert camera.requests["STREAMON"] == (4 if request_name == "QBUF" else 1)


def test_a_stream_that_lost_all_its_buffers_is_opened_anew(
    remote: RemoteCamera, bench: Bench
) -> None:
    with served(remote, bench) as camera:
        remote.ask("open", SETTINGS)
        camera.faults.fail("QBUF", errno.EIO, times=4)
        with pytest.raises(DeviceError, match="stands still"):
            remote.grab(20)
        assert len(remote.grab(20)) == 20


@pytest.mark.parametrize("kind", ["flagged", "short"])
def test_torn_frames_are_refused_and_others_taken(
    remote: RemoteCamera, bench: Bench, kind: str
) -> None:
    """A short frame keeps the old content of its buffer's end; all rows are checked."""

    def render(exposure: Exposure, seen: object) -> NDArray[Any]:
        shape = (exposure.height_px, exposure.width_px)
        return np.full(shape, exposure.sequence % 65536, np.uint16)

    bench.render = render  # type: ignore[method-assign]  # another picture
    with served(remote, bench) as camera:
        remote.ask("open", SETTINGS)
        remote.grab(1)
        for _ in range(3):
            remote.begin("grab", 30)
            bench.wait_exposures(8)
            camera.faults.bad_frames.extend([kind] * 3)  # type: ignore[list-item]  # one of the two
            frames = remote.answer()
            assert not camera.faults.bad_frames
            values = [np.unique(frame.image) for frame in frames]
            assert all(len(value) == 1 for value in values)
            gaps = np.diff([int(value[0]) for value in values])
            assert gaps.max() >= 4  # the three are not among them


@pytest.mark.parametrize(
    ("kind", "message"),
    [("flagged", "was flagged as bad by the driver"), ("short", "had 3072 of 6144 bytes")],
)
def test_torn_frames_in_a_series_are_an_error(
    remote: RemoteCamera, bench: Bench, kind: str, message: str
) -> None:
    with served(remote, bench) as camera:
        remote.ask("open", SETTINGS)
        camera.faults.bad_frames.extend([kind] * 40)  # type: ignore[list-item]  # one of the two
        with pytest.raises(DeviceError, match=f"{WHO}: 4 bad frames in a series, .*{message}"):
            remote.grab(1)
        camera.faults.bad_frames.clear()
        assert len(remote.grab(2)) == 2


def test_counts_beyond_the_bit_depth(remote: RemoteCamera, bench: Bench) -> None:
    settings = replace(SETTINGS, bit_depth=12)
    with served(remote, bench):
        remote.ask("open", settings)
        bench.level = 4095
        assert level(remote.grab(1)[0]) == 4095
        bench.level = 4096
        with pytest.raises(
            DeviceError, match=f"{WHO}: a pixel has 4096 counts, 12 bits allow 4095: .*left-aligned"
        ):
            remote.grab(1)


def test_a_driver_that_hangs_holds_nobody(remote: RemoteCamera, bench: Bench) -> None:
    """The device model answers no DQBUF any more; after a while it does again."""
    free = threading.Event()
    free.set()
    show = bench.render

    def render(exposure: Exposure, seen: object) -> NDArray[Any]:
        free.wait()
        return show(exposure, seen)

    bench.render = render  # type: ignore[method-assign]  # another picture
    with served(remote, bench):
        remote.ask("open", SETTINGS)
        remote.grab(1)
        free.clear()
        start_s = time.monotonic()
        with pytest.raises(DeviceError, match=f"{WHO}: its driver has not answered for .*cable"):
            remote.grab(1)
        assert time.monotonic() - start_s < 0.001 + FOUND_WITHIN_S
        with pytest.raises(DeviceError, match=rf"{WHO}: its driver hangs;.*still so after 2 s\)"):
            remote.grab(1)
        free.set()
        assert len(remote.grab(2)) == 2


def test_ctrl_c_ends_a_long_exposure_at_once(remote: RemoteCamera, bench: Bench) -> None:
    with served(remote, bench) as camera:
        remote.ask("open", SETTINGS)
        remote.set_exposure_s(2.0)
        taken = camera.requests["DQBUF"]
        remote.begin("grab", 1)
        wait_for(lambda: camera.requests["DQBUF"] > taken, "the first old frame")
        start_s = time.monotonic()
        remote.interrupt()
        with pytest.raises(KeyboardInterrupt):
            remote.answer()
        assert time.monotonic() - start_s < 1.0
        remote.set_exposure_s(0.001)
        remote.ask("close")


def test_a_closed_camera_says_so(remote: RemoteCamera, bench: Bench) -> None:
    with served(remote, bench):
        remote.ask("open", SETTINGS)
        assert remote.ask("closed_grab") == (f"camera {DEVICE}: is closed; open it anew")


def test_blind_streams_are_found_frozen_too(remote: RemoteCamera, bench: Bench) -> None:
    """Without the descriptor OpenCV waits, in whole seconds."""
    with served(remote, bench) as camera:
        remote.ask("open_blind", SETTINGS)
        camera.faults.frozen = True
        start_s = time.monotonic()
        with pytest.raises(DeviceError, match="stands still"):
            remote.grab(8)
        assert time.monotonic() - start_s < 0.001 + FOUND_WITHIN_S + 0.5
