"""Stages on emulated controllers, each with the wire and the motor behind it, for the tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial

from drivers.lines.serial_line import Line
from drivers.stages.motor_stage import Limits
from drivers.stages.newport import NewportStage
from drivers.stages.oriental import OrientalSettings, OrientalStage
from drivers.stages.zaber import ZaberStage
from instrument.clock import SystemClock
from instrument.devices import Stage
from sim.emulated.modbus_tcp_gateway import ModbusTcpGateway
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.newport_controller import NewportController
from sim.emulated.oriental_controller import OrientalController
from sim.emulated.wire import PtyWire, TcpWire
from sim.emulated.zaber_controller import MICROSTEPS_PER_DEG, ZaberController

# Quick mechanics: tests wait for real motion. The controller's limits are wider on one side.
MECHANICS = Mechanics(
    min_deg=-95.0, max_deg=80.0, speed_deg_per_s=2000.0, acceleration_deg_per_s2=40000.0,
    home_deg=0.0, homing_s=0.05,
)  # fmt: skip
LIMITS = Limits(
    min_deg=-90.0, max_deg=90.0, speed_deg_per_s=2000.0, acceleration_deg_per_s2=40000.0,
    tolerance_deg=0.01, homing_s=3.0,
)  # fmt: skip
SLOW = Mechanics(
    min_deg=-95.0, max_deg=80.0, speed_deg_per_s=20.0, acceleration_deg_per_s2=400.0,
    home_deg=0.0, homing_s=0.05,
)  # fmt: skip


@dataclass
class Bench:
    """A stage under test and what is behind it.

    `alarm`: a fault in its controller's own code; `stop`: the bytes of a stop.
    """

    stage: Stage
    motor: Motor
    wire: PtyWire | TcpWire
    alarm: str
    stop: bytes
    moves: Callable[[], int]
    reopen: Callable[[], Stage] = field(repr=False)
    max_deg: float = 80.0  # the narrower of the controller's limit and the rig file's


@contextmanager
def newport(mechanics: Mechanics = MECHANICS) -> Iterator[Bench]:
    """An SMC100 on a pseudo-terminal."""
    clock = SystemClock()
    motor = Motor(mechanics, clock)
    controller = NewportController(motor)

    def open_stage() -> NewportStage:
        line = Line("theta_r", wire.port, 57600)
        return NewportStage("theta_r", line, 1, "SMC100", _limits(mechanics), clock)

    with PtyWire([controller]) as wire:
        stage = open_stage()
        yield Bench(stage, motor, wire, "0020", b"1ST", lambda: controller.moves, open_stage)
        stage.close()


@contextmanager
def zaber(mechanics: Mechanics = MECHANICS) -> Iterator[Bench]:
    """An X-RSW60 on a pseudo-terminal."""
    clock = SystemClock()
    motor = Motor(mechanics, clock)
    controller = ZaberController(motor)

    def open_stage() -> ZaberStage:
        line = Line("theta_r", wire.port, 115200)
        limits = _limits(mechanics)
        return ZaberStage("theta_r", line, 1, 1, MICROSTEPS_PER_DEG, limits, clock)

    with PtyWire([controller]) as wire:
        stage = open_stage()
        yield Bench(stage, motor, wire, "FS", b" stop:", lambda: controller.moves, open_stage)
        stage.close()


@contextmanager
def oriental(kind: type[PtyWire | TcpWire], mechanics: Mechanics = MECHANICS) -> Iterator[Bench]:
    """An AZ drive on a pseudo-terminal, or behind a gateway."""
    clock = SystemClock()
    motor = Motor(mechanics, clock)
    drive = OrientalController(motor, steps_per_deg=STEPS_PER_DEG)

    def open_stage() -> OrientalStage:
        port = f"tcp://{wire.host}:{wire.port}" if isinstance(wire, TcpWire) else wire.port
        settings = OrientalSettings(port, STEPS_PER_DEG, _limits(mechanics), parity="N")
        return OrientalStage("theta_r", settings, clock)

    with kind([drive if kind is PtyWire else ModbusTcpGateway([drive])]) as wire:
        stage = open_stage()
        stop = bytes.fromhex("06007D0020")
        yield Bench(stage, motor, wire, "30", stop, lambda: drive.triggers, open_stage, 90.0)
        stage.close()


def _limits(mechanics: Mechanics) -> Limits:
    return Limits(
        LIMITS.min_deg,
        LIMITS.max_deg,
        mechanics.speed_deg_per_s,
        mechanics.acceleration_deg_per_s2,
        LIMITS.tolerance_deg,
        LIMITS.homing_s,
    )


STEPS_PER_DEG = 1000.0
BENCHES = {
    "newport": newport,
    "zaber": zaber,
    "oriental rtu": partial(oriental, PtyWire),
    "oriental tcp": partial(oriental, TcpWire),
}
