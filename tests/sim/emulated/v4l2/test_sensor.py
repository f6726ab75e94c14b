"""Free-running sensor: order of exposures, delay, stop and start, and its exposure control."""

from __future__ import annotations

import threading
from queue import Queue

import numpy as np
import pytest

from drivers.v4l2 import ioctl
from sim.emulated.v4l2.device import Capabilities, EmulatedCamera, Exposure
from sim.emulated.v4l2.sensor import FreeRunningSensor
from tests.support.v4l2.remote_camera import DEADLINE_S

QUICK = Capabilities(frames_per_s=500, overhead_s=0.001, delay_frames=2)


def camera(capabilities: Capabilities = QUICK) -> EmulatedCamera:
    model = EmulatedCamera(lambda *_: np.zeros((1, 1), np.uint8), lambda: "scene", capabilities)
    model.set_value(ioctl.EXPOSURE_AUTO, 1)
    model.set_value(ioctl.EXPOSURE_ABSOLUTE, capabilities.exposure_range[0])
    return model


def test_frames_follow_each_other_and_end_after_their_exposure() -> None:
    frames: Queue[tuple[Exposure, object, float]] = Queue()
    sensor = FreeRunningSensor(camera(), lambda *frame: frames.put(frame))
    assert not sensor.running
    sensor.start()
    sensor.start()  # a second sensor would repeat the numbers
    taken = [frames.get(timeout=DEADLINE_S) for _ in range(6)]
    sensor.stop()
    sensor.stop()
    assert not sensor.running
    assert [exposure.sequence for exposure, _, _ in taken] == list(range(6))
    assert {seen for _, seen, _ in taken} == {"scene"}
    for exposure, _, end_s in taken:
        assert end_s - exposure.start_s >= exposure.exposure_s + 0.001 - 1e-9
    starts = [exposure.start_s for exposure, _, _ in taken]
    assert starts == sorted(starts)


def test_no_frame_is_read_out_after_stop_and_a_new_start_counts_anew() -> None:
    frames: Queue[int] = Queue()
    sensor = FreeRunningSensor(camera(), lambda exposure, *_: frames.put(exposure.sequence))
    for _ in range(3):
        sensor.start()
        assert frames.get(timeout=DEADLINE_S) == 0
        sensor.stop()
        while not frames.empty():
            frames.get()


def test_a_new_exposure_takes_effect_after_the_delay() -> None:
    """Of the frames after the change as many have the old one as are in the pipeline."""
    model = camera()
    exposures: Queue[float] = Queue()

    def read_out(exposure: Exposure, _: object, __: float) -> None:
        if exposure.sequence == 2:  # between two exposures
            model.set_value(ioctl.EXPOSURE_ABSOLUTE, 30)
        exposures.put(exposure.exposure_s)

    sensor = FreeRunningSensor(model, read_out)
    sensor.start()
    taken = [exposures.get(timeout=DEADLINE_S) for _ in range(8)]
    sensor.stop()
    assert taken == pytest.approx([0.0001] * 5 + [0.003] * 3)


def test_stop_interrupts_a_read_out_that_waits() -> None:
    waiting, interrupted = threading.Event(), threading.Event()

    def read_out(*_: object) -> None:
        waiting.set()
        assert interrupted.wait(DEADLINE_S)

    sensor = FreeRunningSensor(camera(), read_out, interrupted.set)
    sensor.start()
    assert waiting.wait(DEADLINE_S)
    sensor.stop()
    assert not sensor.running


@pytest.mark.parametrize(
    ("limits", "default"), [((1, 100_000, 1), 157), ((20, 2047, 1), 157), ((200, 900, 7), 200),
                            ((1, 10_001, 10), 151), ((1, 100, 1), 100)],
)  # fmt: skip
def test_the_exposure_control_has_the_range_of_the_capabilities(
    limits: tuple[int, int, int], default: int
) -> None:
    control = camera(Capabilities(exposure_range=limits)).controls()[ioctl.EXPOSURE_ABSOLUTE]
    assert (control.minimum, control.maximum, control.step) == limits
    assert control.default == default
