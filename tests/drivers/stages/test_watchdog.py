"""Watchdog: a motion without a status report is stopped, whatever the program is doing."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import replace

import pytest

from drivers.stages.motor_stage import POLL_S, MotorStage
from drivers.stages.watchdog import SILENT_S, Watchdog
from instrument.clock import SystemClock
from instrument.errors import ComputerPaused, DeviceError
from sim.emulated.wire import Fault
from tests.support.stages.emulated_stages import EMULATED_STAGES, SLOW, EmulatedStage
from tests.support.stages.waiting import wait_until

pytestmark = pytest.mark.waits

SILENCE = [Fault("drop")] * 500
SLACK_S = 0.4  # a stop may wait for a pending answer; CI has two cores


@pytest.fixture(params=list(EMULATED_STAGES))
def emulated(request: pytest.FixtureRequest) -> Iterator[EmulatedStage]:
    """A slow stage under way, while nobody waits for it."""
    with EMULATED_STAGES[request.param](SLOW) as emulated:
        emulated.stage.home()
        emulated.stage.start_move(70.0)  # takes 3.5 s
        wait_until(lambda: emulated.motor.position_deg > 1.0)
        yield emulated


def test_the_watchdog_probes_while_nobody_polls(
    emulated: EmulatedStage,
) -> None:
    wait_until(lambda: emulated.motor.position_deg > 30.0)  # more than a second later, at 20 deg/s
    assert emulated.motor.moving
    assert emulated.stage.wait() == pytest.approx(70.0, abs=1e-2)


def test_a_silent_line_ends_the_motion_if_nobody_waits(emulated: EmulatedStage) -> None:
    silent_s = time.monotonic()
    emulated.wire.inject(*SILENCE)
    wait_until(lambda: not emulated.motor.moving)
    assert time.monotonic() - silent_s < SILENT_S + SLACK_S
    assert emulated.motor.position_deg < 60.0
    with pytest.raises(DeviceError, match=r"theta_r.*no status for 0.5 s while it moved"):
        emulated.stage.wait()


def test_a_silent_line_ends_the_motion_while_it_is_waited_for(emulated: EmulatedStage) -> None:
    threading.Timer(0.1, lambda: emulated.wire.inject(*SILENCE)).start()
    with pytest.raises(DeviceError, match=r"theta_r.*told to stop"):
        emulated.stage.wait()
    wait_until(lambda: not emulated.motor.moving)
    assert emulated.motor.position_deg < 60.0


class HeldUp(SystemClock):
    """Clock on which the program is held up between two polls, until it is released."""

    def __init__(self) -> None:
        self.holds = threading.Event()
        self.released = threading.Event()

    def sleep(self, seconds: float) -> None:
        if seconds == POLL_S and self.holds.is_set():
            assert self.released.wait(10)
        super().sleep(seconds)


@pytest.mark.parametrize("emulated", ["newport"], indirect=True)
def test_a_program_that_is_held_up_while_it_waits_ends_the_motion(emulated: EmulatedStage) -> None:
    """The line answers all the time."""
    clock, stage = HeldUp(), emulated.stage
    assert isinstance(stage, MotorStage)
    stage._clock = clock
    clock.holds.set()
    found: list[ComputerPaused] = []

    def wait() -> None:
        with pytest.raises(
            ComputerPaused, match=r"the program did not look at it for 0\."
        ) as paused:
            stage.wait()
        found.append(paused.value)

    waiting = threading.Thread(target=wait)
    waiting.start()
    wait_until(lambda: not emulated.motor.moving)
    assert emulated.motor.position_deg < 60.0
    clock.released.set()
    waiting.join(timeout=10)
    assert found


@pytest.mark.parametrize("emulated", ["newport"], indirect=True)
def test_a_stall_ends_the_motion_though_nobody_waits(emulated: EmulatedStage) -> None:
    emulated.motor.hold()
    wait_until(lambda: not emulated.motor.moving)
    with pytest.raises(DeviceError, match=r"theta_r: stalled at .* look for what holds the stage"):
        emulated.stage.wait()


@pytest.mark.parametrize("emulated", ["newport", "zaber", "oriental rtu"], indirect=True)
def test_a_stage_that_runs_astray_is_stopped_though_nobody_waits(emulated: EmulatedStage) -> None:
    """Something else commands it, or its encoder counts the wrong way."""
    emulated.motor.move(-80.0)
    wait_until(lambda: not emulated.motor.moving)
    assert emulated.motor.position_deg > -30.0
    with pytest.raises(DeviceError, match=r"theta_r: runs astray, at -.* on the way to 70 deg"):
        emulated.stage.wait()


@pytest.mark.parametrize("emulated", ["newport"], indirect=True)
def test_a_motion_is_watched_on_after_an_error_until_it_is_stopped(
    emulated: EmulatedStage, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(retry: bool = True) -> None:
        monkeypatch.undo()
        raise KeyboardInterrupt

    monkeypatch.setattr(emulated.stage, "status", interrupted)
    with pytest.raises(KeyboardInterrupt):
        emulated.stage.wait()
    wait_until(lambda: not emulated.motor.moving)
    assert emulated.motor.position_deg < 60.0


def test_homing_is_watched_too() -> None:
    for make in EMULATED_STAGES.values():
        with make(replace(SLOW, homing_s=10.0)) as emulated:
            threading.Timer(0.1, lambda wire=emulated.wire: wire.inject(*SILENCE)).start()
            with pytest.raises(DeviceError, match="told to stop"):
                emulated.stage.home()
            wait_until(lambda motor=emulated.motor: not motor.homing)


def test_the_watchdog_runs_only_during_a_motion() -> None:
    stops: list[float] = []
    watchdog = Watchdog(
        "theta_r", lambda: None, lambda: stops.append(time.monotonic()), SystemClock()
    )
    watchdog.begin()
    watchdog.end()
    begun_s = time.monotonic()
    watchdog.begin()
    wait_until(lambda: bool(stops))
    assert SILENT_S < stops[0] - begun_s < SILENT_S + SLACK_S
    assert len(stops) == 1
    assert watchdog.fired
