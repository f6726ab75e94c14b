"""Modbus line: every fault at every step gives the right value or a named error, and one move."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TypeVar

import pytest

from drivers.lines.modbus_bus import ModbusBus, ModbusUnit
from drivers.lines.modbus_client import BusSettings
from drivers.lines.serial_line import REOPEN_S, PortGone
from drivers.stages.motor_stage import Stopped
from drivers.stages.oriental import OrientalStage
from drivers.stages.oriental_framing import value_of
from drivers.stages.watchdog import silence_allowed_s
from instrument.clock import SystemClock
from instrument.errors import DeviceError
from sim.emulated.wire import Fault, PtyWire
from tests.support.stages.emulated_az_drive import (
    LIMITS,
    SLOW,
    SLOW_LIMITS,
    STEPS_PER_DEG,
    WIRES,
    EmulatedDrive,
    emulated_drive,
)
from tests.support.stages.kinds import AzStage
from tests.support.stages.waiting import wait_until

pytestmark = pytest.mark.waits

REPLY_S = 0.07  # a delayed answer still has as long as counts as a standstill
FAULTS = {
    "drop": Fault("drop"),
    "delay": Fault("delay", 0.2 * REPLY_S),
    "late": Fault("late", 1.5 * REPLY_S),
    "later than the quiet": Fault("late", 2.4 * REPLY_S),
    "much later": Fault("late", 4.0 * REPLY_S),
    "garbage": Fault("garbage"),
    "truncate": Fault("truncate"),
    "nul": Fault("nul"),
    "lose request": Fault("lose request"),
    "unplug": Fault("unplug"),
}
TARGET = 8.0
T = TypeVar("T")


def _moved(az: EmulatedDrive, stage: OrientalStage) -> float:
    stage.start_move(TARGET)
    return stage.wait()


@pytest.fixture(params=WIRES)
def az(request: pytest.FixtureRequest) -> Iterator[EmulatedDrive]:
    with emulated_drive(request.param, reply_s=0.1) as made:
        yield made


@pytest.mark.parametrize(("kind", "after"), [("pty", 0), ("tcp", 2)])
@pytest.mark.parametrize("fault", FAULTS)
def test_fault_while_opening(kind: str, fault: str, after: int) -> None:
    with emulated_drive(kind, reply_s=REPLY_S) as az:
        az.wire.inject(*[None] * after, FAULTS[fault])
        told = _outcome(fault, lambda: az.open().identity())
        assert told is None or "AZ drive" in told
        assert az.wire.pending == 0


@pytest.mark.parametrize(("kind", "after"), [("pty", 0), ("tcp", 1)])
@pytest.mark.parametrize("fault", FAULTS)
def test_fault_while_reading_the_status(kind: str, fault: str, after: int) -> None:
    with emulated_drive(kind, reply_s=REPLY_S) as az:
        stage = az.homed()
        az.motor.move(TARGET)
        wait_until(lambda: not az.motor.moving)
        az.wire.inject(*[None] * after, FAULTS[fault])
        for _ in range(3):
            assert _outcome(fault, stage.position_deg) in (TARGET, None)
        assert az.wire.pending == 0


@pytest.mark.parametrize(("kind", "again"), [("pty", False), ("pty", True), ("tcp", False)])
@pytest.mark.parametrize("fault", FAULTS)
def test_fault_while_writing_a_move(kind: str, fault: str, again: bool) -> None:
    with emulated_drive(kind, reply_s=REPLY_S) as az:
        stage, moves = az.homed(), 1
        if again:  # the drive holds the same target already, and stands elsewhere
            assert _moved(az, stage) == TARGET
            az.motor.move(0.0)
            wait_until(lambda: not az.motor.moving)
            moves = 2
        since = len(az.wire.seen)
        az.wire.inject(None, None, None, FAULTS[fault])  # after status, position and READY
        assert _outcome(fault, lambda: _moved(az, stage)) in (TARGET, None)
        assert az.wire.pending == 0
        assert b"\x10\x00\x58" in az.wire.seen[since + 3][1]  # it was the move that was hit
        assert az.drive.triggers == moves
        sent = len(az.sent(b"\x10\x00\x58", since))
        assert sent == (2 if fault == "lose request" else 1)


@pytest.mark.parametrize("kind", WIRES)
@pytest.mark.parametrize("fault", FAULTS)
def test_fault_while_waiting(kind: str, fault: str) -> None:
    with emulated_drive(kind, reply_s=REPLY_S) as az:
        stage = az.homed()
        stage.start_move(TARGET)
        az.wire.inject(None, FAULTS[fault])
        assert _outcome(fault, stage.wait) in (TARGET, None)
        assert az.wire.pending == 0
        assert az.drive.triggers == 1


@pytest.mark.parametrize("kind", ["pty"])
@pytest.mark.parametrize("fault", FAULTS)
def test_fault_while_homing(kind: str, fault: str) -> None:
    with emulated_drive(kind, reply_s=REPLY_S) as az:
        stage = az.open()
        since = len(az.wire.seen)
        az.wire.inject(None, None, None, None, FAULTS[fault])  # after the input word and READY
        _outcome(fault, stage.home)
        assert b"\x10\x00\x7d" in az.wire.seen[since + 4][1]
        assert az.drive.homings == 1
        if fault != "unplug":
            assert stage.position_deg() == 0.0
            assert az.motor.referenced


@pytest.mark.parametrize(
    ("kind", "fault"),
    [("pty", name) for name in FAULTS if name != "unplug"]  # see test_returning_port
    + [("tcp", name) for name in ("late", "nul", "unplug")],
)
def test_fault_while_stopping(kind: str, fault: str) -> None:
    with emulated_drive(kind, reply_s=2 * REPLY_S) as az:
        stage = az.homed()
        az.motor.move(-170.0)
        az.wire.inject(replace(FAULTS[fault], seconds=2 * FAULTS[fault].seconds))
        _outcome(fault, stage.stop, REOPEN_S + 1.0)
        assert not az.motor.moving
        if fault != "unplug":
            here = az.motor.position_deg
            assert stage.position_deg() == pytest.approx(here, abs=0.005)


@pytest.mark.parametrize("kind", ["pty"])
@pytest.mark.parametrize("first", ["late", "truncate", "lose request"])
@pytest.mark.parametrize("second", ["drop", "later than the quiet"])
def test_two_faults_in_a_row_at_a_move(kind: str, first: str, second: str) -> None:
    with emulated_drive(kind, reply_s=REPLY_S) as az:
        stage = az.homed()
        az.wire.inject(None, None, None, FAULTS[first], FAULTS[second])
        assert _outcome("", lambda: _moved(az, stage)) == TARGET
        assert az.drive.triggers == 1


def test_after_a_line_dies_during_a_move_command_the_error_warns_of_motion() -> None:
    with emulated_drive("pty") as az:
        stage = az.homed()
        az.wire.inject(None, None, None, *[Fault("drop")] * 9)
        begun_s = time.monotonic()
        with pytest.raises(DeviceError, match=r"no answer within 0.25 s.*not known: it may move"):
            stage.start_move(TARGET)
        # What is tried ends with the silence that the watchdog allows; then a stop is tried for six
        # answers. Each ends with an exchange that has begun: an answer's time, and as long a quiet.
        assert time.monotonic() - begun_s < silence_allowed_s(0.25) + 6 * 0.25 + 4 * 2 * 0.25
        assert az.drive.triggers == 1


def test_a_stop_forbids_the_second_try_of_a_lost_move() -> None:
    with emulated_drive("pty") as az:
        stage, told = az.homed(), []
        since = len(az.wire.seen)
        az.wire.inject(None, None, None, Fault("lose request"))

        def move() -> None:
            with pytest.raises(Stopped, match="stopped before it began to move"):
                stage.start_move(TARGET)
            told.append("stopped")

        moving = threading.Thread(target=move)
        moving.start()
        wait_until(lambda: len(az.sent(b"\x10\x00\x58", since)) == 1)
        stage.stop()
        moving.join(timeout=5)
        assert told == ["stopped"]
        assert az.drive.triggers == 0


@pytest.mark.parametrize("late", [1.5, 2.4, 4.0])
def test_a_late_answer_is_never_taken_for_another(late: float) -> None:
    """Command and feedback position have the same form; only waiting separates their answers."""
    with emulated_drive("pty", SLOW, SLOW_LIMITS) as az:
        stage = az.homed()
        stage.start_move(90.0)
        az.motor.hold()
        held = round(az.motor.position_deg * STEPS_PER_DEG)
        stage.close()
        with ModbusBus(
            "line", BusSettings(az.port, parity="N", reply_s=REPLY_S), SystemClock()
        ) as bus:
            unit = ModbusUnit(bus, "line", 1, 0x58, (6, 8, 10, 12, 14))
            az.wire.inject(None, Fault("late", late * REPLY_S))
            for _ in range(3):
                assert value_of(unit.read(0xC6, 2)) == 9000
                assert value_of(unit.read(0xCC, 2)) == held


@pytest.mark.parametrize(
    ("port", "says"),
    [("/dev/none", "cannot open /dev/none"), ("tcp://localhost:1", "cannot open tcp://localhost")],
)
def test_a_missing_port_is_named(port: str, says: str) -> None:
    with pytest.raises(PortGone, match=says):
        AzStage(BusSettings(port), LIMITS)


def test_a_parity_that_the_port_refuses_is_named() -> None:
    with PtyWire([]) as wire, pytest.raises(PortGone, match=r"'X': look at .*, at the parity"):
        AzStage(BusSettings(wire.port, parity="X"), LIMITS)  # type: ignore[arg-type]


def test_a_closed_line_stays_closed(az: EmulatedDrive) -> None:
    stage = az.homed()
    stage.close()
    stage.close()
    for action in (stage.status, stage.stop):
        with pytest.raises(PortGone, match="it was closed"):
            action()


def test_a_gateway_that_has_hung_up_is_reconnected() -> None:
    with emulated_drive("tcp") as az:
        stage = az.homed()
        peer = az.wire._peer  # type: ignore[union-attr]  # a TcpWire's
        assert peer is not None
        peer.shutdown(2)
        assert stage.position_deg() == 0.0


def _outcome(fault: str, action: Callable[[], T], within_s: float = 2.0) -> T | None:
    """Result of an action in time; None for a named error, allowed only after an unplug."""
    begun_s = time.monotonic()
    if fault == "unplug":
        value = None
        with pytest.raises(PortGone, match=r"theta_r: .*(is gone|cannot open)"):
            action()
    else:
        value = action()
    assert time.monotonic() - begun_s < within_s
    return value
