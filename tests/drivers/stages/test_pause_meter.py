"""Pause of the computer while a stage moves: told apart from a silent line, and named."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import pytest

from drivers.lines.serial_line import NoReply
from drivers.stages.motion import Limits
from drivers.stages.motor_stage import MotorStage
from drivers.stages.pause_meter import PAUSE_S, PauseMeter
from instrument.clock import SystemClock
from instrument.errors import ComputerPaused, DeviceError
from sim.emulated.motor import Motor
from sim.emulated.wire import Controller, Fault, PtyWire
from tests.support.paths import ROOT
from tests.support.stages.emulated_stages import LIMITS, SLOW
from tests.support.stages.kinds import SERIAL, controller_for, open_stage
from tests.support.stages.waiting import wait_until

pytestmark = pytest.mark.waits

PAUSED_S = 1.3


class PausingClock(SystemClock):
    """Clock that jumps ahead, as the monotonic clock does while a process is stopped."""

    def __init__(self) -> None:
        self._paused_s = 0.0

    def now_s(self) -> float:
        return super().now_s() + self._paused_s

    def pause(self, seconds: float = PAUSED_S) -> None:
        self._paused_s += seconds


class PausedInACommand:
    """Line on which the computer pauses while a command is under way; answers once it was noted.

    `lost`: that answer never comes.
    """

    def __init__(self, controller: Controller, clock: PausingClock) -> None:
        self._controller, self._clock = controller, clock
        self.command: bytes | None = None
        self.noted, self.lost = threading.Event(), False

    def answer(self, data: bytes) -> bytes:
        if self.command and self.command in data:
            self.command = None
            self._clock.pause()
            assert self.noted.wait(5)
            answer = self._controller.answer(data)
            return b"" if self.lost else answer
        return self._controller.answer(data)


class Setup:
    def __init__(self, kind: str) -> None:
        self.clock = PausingClock()
        self.motor = Motor(SLOW, self.clock)
        controller, self.moves = controller_for(kind, self.motor, self.clock)
        self.line = PausedInACommand(controller, self.clock)
        self.wire = PtyWire([self.line])
        limits = Limits(
            min_deg=-90.0, max_deg=90.0, speed_deg_per_s=SLOW.speed_deg_per_s,
            acceleration_deg_per_s2=SLOW.acceleration_deg_per_s2,
            tolerance_deg=LIMITS.tolerance_deg, homing_s=3.0,
        )  # fmt: skip
        self.stage: MotorStage = open_stage(kind, self.wire.port, limits, self.clock)
        self.stage.home()

    def moves_on(self) -> bool:
        """Move a little from where the stage stands, with its reference."""
        assert self.stage.homed()
        target_deg = self.stage.position_deg() + 1.0
        self.stage.start_move(target_deg)
        return self.stage.wait() == pytest.approx(target_deg, abs=1e-2)


@pytest.fixture(params=SERIAL)
def setup(request: pytest.FixtureRequest) -> Iterator[Setup]:
    made = Setup(request.param)
    yield made
    made.stage.close()
    made.wire.close()


def paused_under_way(setup: Setup) -> None:
    setup.stage.start_move(70.0)  # takes 3.5 s
    wait_until(lambda: setup.motor.position_deg > 1.0)
    with setup.stage.watchdog._asking:  # the program is about to ask for the status
        setup.clock.pause()
        wait_until(lambda: setup.stage.watchdog.fired)


def test_a_pause_during_a_move_is_named_and_the_stage_stopped(setup: Setup) -> None:
    paused_under_way(setup)
    with pytest.raises(ComputerPaused, match=r"theta_r: the computer paused for 1.3 s while it"):
        setup.stage.wait()
    wait_until(lambda: not setup.motor.moving)
    assert setup.motor.position_deg < 60.0
    assert setup.moves_on()


@pytest.mark.parametrize(
    ("setup", "command"),
    [("newport", b"1PA"), ("zaber", b"move abs"), ("oriental rtu", b"\x10\x00\x58")],
    indirect=["setup"],
)
def test_a_pause_while_the_move_is_sent_is_named(setup: Setup, command: bytes) -> None:
    setup.line.command = command
    watchdog = setup.stage.watchdog
    threading.Thread(
        target=lambda: (wait_until(lambda: watchdog.fired), setup.line.noted.set())
    ).start()
    with pytest.raises(ComputerPaused, match=r"theta_r: the computer paused for 1.3 s"):
        setup.stage.start_move(70.0)
    assert setup.moves_on()


@pytest.mark.parametrize("setup", ["oriental rtu"], indirect=True)
def test_answers_that_are_lost_in_a_pause_are_no_fault_of_the_line(setup: Setup) -> None:
    """The drive's registers cannot be asked in time whether it has taken the move."""
    setup.line.command, setup.line.lost = b"\x10\x00\x58", True
    watchdog = setup.stage.watchdog

    def much_later() -> None:
        wait_until(lambda: watchdog.fired)
        setup.clock.pause()
        setup.line.noted.set()

    threading.Thread(target=much_later).start()
    with pytest.raises(ComputerPaused, match=r"theta_r: .*the computer paused for 1.3 s"):
        setup.stage.start_move(70.0)
    assert setup.moves_on()


@pytest.mark.parametrize("setup", ["oriental rtu"], indirect=True)
def test_a_pause_is_named_also_if_the_watchdogs_thread_wakes_last(
    setup: Setup, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(setup.stage.watchdog, "_watch", lambda over: over.wait(5))
    setup.line.command, setup.line.lost = b"\x10\x00\x58", True
    setup.line.noted.set()
    with pytest.raises(ComputerPaused, match=r"theta_r: .*the computer paused for 1.3 s"):
        setup.stage.start_move(70.0)
    wait_until(lambda: not setup.motor.moving)
    monkeypatch.undo()
    assert setup.moves_on()


def test_a_pause_is_named_also_if_the_status_comes_before_the_watchdogs_thread(
    setup: Setup, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(setup.stage.watchdog, "_watch", lambda over: over.wait(5))
    setup.stage.start_move(70.0)
    wait_until(lambda: setup.motor.position_deg > 1.0)
    setup.clock.pause()
    with pytest.raises(ComputerPaused, match=r"theta_r: the computer paused for 1.3 s"):
        setup.stage.wait()
    wait_until(lambda: not setup.motor.moving)
    monkeypatch.undo()
    assert setup.moves_on()


@pytest.mark.parametrize("setup", ["newport"], indirect=True)
def test_the_watchdogs_stop_does_not_end_the_next_move(
    setup: Setup, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stop may have to wait for the line or for its port; nothing moves on before it is sent."""
    may_send, send = threading.Event(), setup.stage._send_stop
    monkeypatch.setattr(setup.stage._stop, "_soft", lambda: (may_send.wait(5), send()))
    paused_under_way(setup)
    going_on = threading.Thread(target=setup.stage.start_move, args=(2.0,))
    going_on.start()
    wait_until(lambda: setup.motor.position_deg > 35.0)  # it is stopped late here
    assert setup.moves() == 1
    may_send.set()
    going_on.join(timeout=5)
    assert setup.stage.wait() == pytest.approx(2.0, abs=1e-2)


@pytest.mark.parametrize("setup", ["newport"], indirect=True)
def test_a_pause_too_short_to_matter_ends_nothing(setup: Setup) -> None:
    """It begins at a status; what passes until the next one counts with it."""
    setup.stage.start_move(20.0)
    wait_until(lambda: setup.motor.position_deg > 1.0)
    answered_s = setup.stage.watchdog._answered_s
    wait_until(lambda: setup.stage.watchdog._answered_s > answered_s)
    setup.clock.pause(1.1 * PAUSE_S)
    assert setup.stage.wait() == pytest.approx(20.0, abs=1e-2)


@pytest.mark.parametrize("setup", ["newport"], indirect=True)
def test_a_line_that_falls_silent_in_a_pause_is_named_before_anything_moves(setup: Setup) -> None:
    moves = setup.moves()
    setup.stage.start_move(70.0)
    setup.wire.inject(*[Fault("drop")] * 500)
    wait_until(lambda: setup.wire.pending < 500)
    setup.clock.pause(1.5 * PAUSE_S)
    with pytest.raises(DeviceError, match=r"theta_r.*no answer within 0.15 s"):
        setup.stage.wait()
    with pytest.raises(NoReply, match=r"theta_r.*no answer within 0.15 s"):
        setup.stage.homed()  # asked before it would be moved on
    assert setup.moves() == moves + 1


def test_a_pause_is_known_before_the_meters_own_thread_wakes() -> None:
    clock, over = PausingClock(), threading.Event()
    meter = PauseMeter(clock)
    meter.begin(over)
    begun_s = clock.now_s()
    assert meter.paused_since_s(begun_s) == 0.0
    clock.pause()
    assert meter.paused_since_s(begun_s) == pytest.approx(PAUSED_S, abs=PAUSE_S)
    assert meter.paused_since_s(clock.now_s() + 1.0) == 0.0
    over.set()


STOPPED_CHILD = """
import sys, threading
from drivers.stages.pause_meter import PauseMeter
from instrument.clock import SystemClock
clock = SystemClock()
meter, begun_s = PauseMeter(clock), clock.now_s()
meter.begin(threading.Event())
print("ready", flush=True)
sys.stdin.readline()
print(meter.paused_since_s(begun_s), flush=True)
"""


def test_a_stopped_process_is_a_pause_of_that_length() -> None:
    command = [sys.executable, "-c", STOPPED_CHILD]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT
    ) as child:
        assert child.stdin is not None
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        begun_s = time.monotonic()
        child.send_signal(signal.SIGSTOP)
        os.waitpid(child.pid, os.WUNTRACED)  # it stands
        stopped_s = time.monotonic()
        wait_until(lambda: time.monotonic() - stopped_s > 3 * PAUSE_S)
        least_s = time.monotonic() - stopped_s
        child.send_signal(signal.SIGCONT)
        child.stdin.write("\n")
        child.stdin.flush()
        measured_s = float(child.stdout.readline())
        assert least_s - PAUSE_S < measured_s < time.monotonic() - begun_s
