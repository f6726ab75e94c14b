"""Two-wire RS-485 adapter that returns each request: known by the request itself, and skipped."""

from __future__ import annotations

import threading

import pytest

from drivers.lines.serial_line import Line, NoReply
from drivers.stages.motor_stage import MotorStage
from instrument.clock import SystemClock
from instrument.errors import DeviceError
from sim.emulated.motor import Motor
from sim.emulated.wire import PtyWire
from tests.support.stages.emulated_stages import LIMITS, MECHANICS, SLOW
from tests.support.stages.kinds import SERIAL, controller_for, open_stage
from tests.support.stages.plug import Echoing
from tests.support.stages.waiting import wait_until

pytestmark = pytest.mark.waits


def opened(kind: str, wire: PtyWire) -> MotorStage:
    return open_stage(kind, wire.port, LIMITS, SystemClock())


@pytest.mark.parametrize("kind", SERIAL)
def test_a_stage_behind_an_echoing_adapter_homes_moves_and_stops(
    kind: str, caplog: pytest.LogCaptureFixture
) -> None:
    motor = Motor(MECHANICS, SystemClock())
    adapter = Echoing(controller_for(kind, motor, SystemClock())[0])
    with PtyWire([adapter]) as wire:
        stage = opened(kind, wire)
        stage.home()
        for angle_deg in (10.0, -20.0, -20.0, 0.0):
            stage.start_move(angle_deg)
            assert stage.wait() == pytest.approx(angle_deg, abs=1e-3)
        stage.stop()
        adapter.echoes = False  # it was replaced by a better one
        assert stage.position_deg() == pytest.approx(0.0, abs=1e-3)
        stage.close()
    assert sum("echo is skipped" in record.getMessage() for record in caplog.records) == 1


@pytest.mark.parametrize("kind", SERIAL)
def test_an_echo_is_not_taken_for_the_answer_of_a_dead_controller(kind: str) -> None:
    """An echoed write of one Modbus register looks like its acknowledgement."""
    motor = Motor(SLOW, SystemClock())
    adapter = Echoing(controller_for(kind, motor, SystemClock())[0])
    with PtyWire([adapter]) as wire:
        stage = opened(kind, wire)
        adapter.dead = True
        with pytest.raises(NoReply, match="look at its power"):
            stage.position_deg()
        if kind.startswith("oriental"):
            with pytest.raises(NoReply, match=r"not read to stand.*it may still move"):
                stage.stop()
        stage.close()


def test_only_an_echo_is_named() -> None:
    adapter = Echoing(controller_for("oriental rtu", Motor(SLOW, SystemClock()), SystemClock())[0])
    adapter.dead = True
    with PtyWire([adapter]) as wire, pytest.raises(DeviceError, match="only the echo"):
        opened("oriental rtu", wire)


@pytest.mark.parametrize("kind", ["newport", "zaber"])
def test_a_stop_on_two_wires_waits_for_the_answer_that_it_would_destroy(kind: str) -> None:
    motor = Motor(SLOW, SystemClock())
    with PtyWire([Echoing(controller_for(kind, motor, SystemClock())[0])]) as wire:
        stage = opened(kind, wire)
        stage.home()
        stage.start_move(70.0)
        line = stage._line
        assert isinstance(line, Line)
        stopping = threading.Thread(target=stage.stop)
        with line.lock.hold():  # an answer is awaited
            sent = len(wire.seen)
            stopping.start()
            wait_until(lambda: line.lock._urgent_waiting == 1)
            assert len(wire.seen) == sent
        stopping.join(timeout=5)
        wait_until(lambda: not motor.moving)
        stage.close()
