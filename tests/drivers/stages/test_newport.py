"""Newport driver: another device on the port is refused."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from dataclasses import replace

import pytest

from drivers.lines.serial_line import Line
from drivers.stages.motor_stage import Stopped
from drivers.stages.newport import NewportStage
from instrument.clock import SystemClock
from instrument.errors import DeviceError
from sim.emulated.motor import Motor
from sim.emulated.newport_controller import NewportController
from sim.emulated.wire import PtyWire
from tests.support.stages.emulated_stages import LIMITS, MECHANICS, SLOW
from tests.support.stages.waiting import wait_until

pytestmark = pytest.mark.waits


class Parrot:
    """Gives the same answer to everything."""

    def __init__(self, words: bytes) -> None:
        self._words = words

    def answer(self, _: bytes) -> bytes:
        return self._words


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            b"1VE CONEX-CC 2.0.1\r\n",
            "calls itself 'CONEX-CC 2.0.1'; expected of a SMC100: SMC_CC or SMC_PP",
        ),
        (
            b"1VE ESP301 Version 3.0.1\r\n",
            "calls itself 'ESP301 Version 3.0.1'; expected of a SMC100: SMC_CC or SMC_PP",
        ),
        (b"@01 0 OK IDLE -- 0\r\n", "only b'@01 0 OK IDLE -- 0'"),
        (b"", "no answer within 0.15 s: look at its power and at the cable"),
    ],
)
def test_another_device_is_refused_and_its_answer_quoted(words: bytes, says: str) -> None:
    with PtyWire([Parrot(words)]) as wire, Line("theta_r", wire.port, 57600, SystemClock()) as line:
        with pytest.raises(DeviceError) as refused:
            NewportStage("theta_r", line, 1, "SMC100", LIMITS, SystemClock())
        assert says in str(refused.value)
        assert str(wire.port) in str(refused.value)


class Renamed(NewportController):
    """Controller with another version."""

    def __init__(self, motor: Motor, version: str) -> None:
        super().__init__(motor)
        self._version = version


@pytest.mark.parametrize(
    ("model", "version"),  # as laboratories quote them from real controllers
    [
        ("SMC100", " SMC_CC - Controller-driver version  3. 1. 2"),
        ("SMC100", " SMC_PP - Controller-driver version  3. 1. 2"),
        ("CONEX-CC", " CONEX-CC 2.0.1"),
        ("CONEX-CC", "CONEX-CC 2.0.1"),
    ],
)
def test_a_real_controllers_version_is_accepted(model: str, version: str) -> None:
    clock = SystemClock()
    controller = Renamed(Motor(MECHANICS, clock), version)
    with PtyWire([controller]) as wire, Line("theta_r", wire.port, 57600, clock) as line:
        stage = NewportStage("theta_r", line, 1, model, LIMITS, clock)
        assert version.strip() in stage.identity()


@pytest.fixture
def deaf() -> Iterator[tuple[NewportStage, Motor]]:
    """A stage whose controller hears nothing for a moment after a command."""
    clock = SystemClock()
    motor = Motor(SLOW, clock)
    limits = replace(LIMITS, speed_deg_per_s=20.0, acceleration_deg_per_s2=400.0)
    with (
        PtyWire([NewportController(motor, deaf_s=0.03)]) as wire,
        Line("theta_r", wire.port, 57600, clock) as line,
    ):
        yield NewportStage("theta_r", line, 1, "SMC100", limits, clock), motor


def test_a_controller_that_is_deaf_after_a_command_is_waited_for(
    deaf: tuple[NewportStage, Motor], caplog: pytest.LogCaptureFixture
) -> None:
    stage, _ = deaf
    stage.home()
    for angle_deg in (2.0, -1.0, 0.5):
        stage.start_move(angle_deg)
        assert stage.wait() == pytest.approx(angle_deg, abs=1e-3)
    lost = [r for r in caplog.records if "may or may not have been taken" in r.getMessage()]
    assert len(lost) < 3  # of the six commands


def test_a_stop_reaches_a_controller_that_is_deaf_after_the_move_command(
    deaf: tuple[NewportStage, Motor],
) -> None:
    stage, motor = deaf
    stage.home()
    stage._port._deaf = False  # so that it is stopped at once after the command
    starting = threading.Thread(target=_start, args=(stage,))
    starting.start()
    wait_until(lambda: motor.moving)
    stage.stop()
    starting.join(timeout=5)
    wait_until(lambda: not motor.moving)
    assert motor.position_deg < 60.0


def _start(stage: NewportStage) -> None:
    with contextlib.suppress(Stopped):
        stage.start_move(70.0)


@pytest.mark.parametrize("before", [b"/1 stop\r\n", b"1PA\xff\r\n", b"1XX\r\n", b"PA1000\r\n"])
def test_an_error_from_before_the_port_was_opened_is_not_taken_for_the_first_commands(
    before: bytes,
) -> None:
    """Another program's bytes, or noise: the controller keeps their error until it is read."""
    clock = SystemClock()
    controller = NewportController(Motor(MECHANICS, clock))
    assert controller.answer(before) == b""
    with PtyWire([controller]) as wire, Line("theta_r", wire.port, 57600, clock) as line:
        stage = NewportStage("theta_r", line, 1, "SMC100", LIMITS, clock)
        with contextlib.closing(stage):
            stage.home()
            assert stage.position_deg() == 0.0
    assert controller.answer(b"1TE\r\n") == b"1TE@\r\n"
