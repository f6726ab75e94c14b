"""Watchdog: a motion without a status report is stopped, whatever the program is doing."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import replace

import pytest

from drivers.stages.watchdog import SILENT_S, Watchdog
from instrument.clock import SystemClock
from instrument.errors import DeviceError
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
