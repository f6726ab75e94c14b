"""Slow gateway or serial server: `reply_s` of the rig file allows for it, and the watchdog too."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from drivers.factory import Lines, open_stage
from drivers.lines.serial_line import NoReply
from drivers.stages.motor_stage import MotorStage
from drivers.stages.watchdog import SILENT_S, silence_allowed_s
from instrument.clock import SystemClock
from instrument.config.axes import NewportAxis, OrientalAxis, Wired
from instrument.config.load import load_rig
from instrument.devices import REPLY_S
from instrument.errors import DeviceError, InputError
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.wire import Fault, PtyWire
from tests.support.stages.bench_rig import write_bench_rig
from tests.support.stages.emulated_stages import port_of
from tests.support.stages.kinds import STEPS_PER_DEG, controller_for
from tests.support.stages.modbus_tcp_gateway import TcpWire
from tests.support.stages.waiting import wait_until

pytestmark = pytest.mark.waits

ANSWER_S = 0.17  # published logs of Modbus TCP gateways: 168 to 170 ms an answer
KEYS: dict[str, Any] = {
    "min_deg": -170.0, "max_deg": 170.0, "u_deg": 0.01, "speed_deg_per_s": 40.0,
    "acceleration_deg_per_s2": 400.0, "settle_s": 0.0,
}  # fmt: skip
MECHANICS = Mechanics(speed_deg_per_s=40.0, acceleration_deg_per_s2=400.0, homing_s=0.05)


@contextmanager
def slow(kind: str, reply_s: float) -> Iterator[tuple[MotorStage, PtyWire | TcpWire, Motor]]:
    """A stage as the rig file opens it, on a line that takes `ANSWER_S` for each answer."""
    clock = SystemClock()
    motor = Motor(MECHANICS, clock)
    motor.home()  # before the test: each poll of a homing takes its time
    controller, _ = controller_for(kind, motor, clock)
    with (TcpWire if kind == "oriental tcp" else PtyWire)([controller]) as wire:
        wire.inject(*[Fault("delay", ANSWER_S)] * 500)
        port, axis = port_of(wire), _axis(kind, port_of(wire), reply_s)
        with Lines(clock) as lines:
            yield open_stage("theta_r", axis, port, lines), wire, motor


def _axis(kind: str, port: str, reply_s: float) -> Wired:
    keys = KEYS | {"port": port, "reply_s": reply_s}
    if kind == "newport":
        return NewportAxis(driver="newport", **keys)
    return OrientalAxis(driver="oriental", steps_per_deg=STEPS_PER_DEG, **keys)


def test_a_line_slower_than_allowed_says_which_key_to_set() -> None:
    refused = pytest.raises(NoReply, match=r"within 0.15 s.*reply_s in the rig file")
    with refused, slow("oriental tcp", REPLY_S):
        pass


def test_a_slow_line_moves_and_recovers_a_lost_answer() -> None:
    with slow("oriental tcp", 2 * ANSWER_S) as (stage, wire, _):
        wait_until(stage.homed)
        stage.start_move(60.0)  # takes 1.6 s
        wire.clear_faults()
        wire.inject(Fault("drop"), *[Fault("delay", ANSWER_S)] * 500)
        assert stage.wait() == pytest.approx(60.0, abs=1e-2)


def test_a_slow_line_that_falls_silent_is_stopped_by_its_own_bound() -> None:
    with slow("newport", 2 * ANSWER_S) as (stage, wire, motor):
        wait_until(stage.homed)
        stage.start_move(170.0)  # takes 4.4 s
        wire.clear_faults()
        wire.inject(*[Fault("drop")] * 500)
        silent_s = time.monotonic()
        wait_until(lambda: not motor.moving)
        assert time.monotonic() - silent_s > SILENT_S
        assert motor.position_deg < 150.0
        with pytest.raises(DeviceError, match=r"no status for 2.02 s while it moved"):
            stage.wait()


@pytest.mark.parametrize("reply_s", [0.05, 0.15, 0.2, 0.5, 1.0])
def test_the_watchdog_allows_for_one_lost_answer(reply_s: float) -> None:
    allowed_s = silence_allowed_s(reply_s)
    assert allowed_s >= SILENT_S
    assert allowed_s - SILENT_S == pytest.approx(8 * max(reply_s - REPLY_S, 0.0))


@pytest.mark.parametrize(
    ("first", "second", "says"),
    [
        ({}, {"reply_s": 0.4}, "reply_s 0.15 and .*reply_s 0.4; allowed on one port: the same"),
        ({"parity": "N"}, {}, "parity N .* and .*parity E .*; allowed on one port: the same"),
        ({"baudrate": 9600}, {}, "baudrate 9600 .* and baudrate 115200"),
        ({"reply_s": 0.0}, {}, "reply_s"),
        ({"reply_s": 20.0}, {}, "reply_s"),
    ],
)
def test_axes_on_one_port_have_the_same_line(
    tmp_path: Path, first: dict[str, Any], second: dict[str, Any], says: str
) -> None:
    keys = KEYS | {"driver": "oriental", "port": "tcp://gateway:502", "steps_per_deg": 1000.0}
    theta_i, dphi = keys | {"unit": 1} | first, keys | {"unit": 2} | second
    path = write_bench_rig(tmp_path / "rig.yaml", theta_i=theta_i, dphi=dphi)
    with pytest.raises(InputError, match=says):
        load_rig(path)
