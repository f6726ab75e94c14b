"""Stages on emulated controllers in real time, each with the wire and the motor behind it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial

from drivers.stages.motion import Limits
from instrument.clock import SystemClock
from instrument.devices import Stage
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.wire import PtyWire
from tests.support.stages.kinds import KINDS, Kind, controller_for, open_stage
from tests.support.stages.modbus_tcp_gateway import TcpWire

# Quick mechanics: tests wait for real motion. The controller's limits are wider on one side.
MECHANICS = Mechanics(
    min_deg=-95.0, max_deg=80.0, speed_deg_per_s=2000.0, acceleration_deg_per_s2=40000.0,
    home_deg=0.0, homing_s=0.05,
)  # fmt: skip
LIMITS = Limits(
    min_deg=-90.0, max_deg=90.0, speed_deg_per_s=2000.0, acceleration_deg_per_s2=40000.0,
    tolerance_deg=0.01, homing_s=3.0,
)  # fmt: skip
SLOW = replace(MECHANICS, speed_deg_per_s=20.0, acceleration_deg_per_s2=400.0)


@dataclass
class EmulatedStage:
    """A stage under test and what is behind it.

    `max_deg`: the narrower of the controller's limit and the rig file's.
    """

    stage: Stage
    motor: Motor
    wire: PtyWire | TcpWire
    kind: Kind
    moves: Callable[[], int]
    reopen: Callable[[], Stage] = field(repr=False)
    max_deg: float


@contextmanager
def emulated(name: str, mechanics: Mechanics = MECHANICS) -> Iterator[EmulatedStage]:
    """A stage of this kind on a pseudo-terminal, or behind a TCP gateway."""
    kind, clock = KINDS[name], SystemClock()
    motor = Motor(mechanics, clock)
    controller, moves = controller_for(name, motor, clock)
    limits = replace(
        LIMITS,
        speed_deg_per_s=mechanics.speed_deg_per_s,
        acceleration_deg_per_s2=mechanics.acceleration_deg_per_s2,
    )
    with (TcpWire if kind.tcp else PtyWire)([controller]) as wire:
        reopen = partial(open_stage, name, port_of(wire), limits, clock)
        max_deg = mechanics.max_deg if kind.keeps_limits else limits.max_deg
        with_stage = EmulatedStage(reopen(), motor, wire, kind, moves, reopen, max_deg)
        yield with_stage
        with_stage.stage.close()


@contextmanager
def repaired(emulated: EmulatedStage) -> Iterator[EmulatedStage]:
    """The same controller, repaired and reopened."""
    emulated.wire.clear_faults()
    emulated.motor.alarm = ""
    emulated.motor.stop()
    emulated.stage.close()
    stage = emulated.reopen()
    try:
        yield replace(emulated, stage=stage)
    finally:
        stage.close()


def port_of(wire: PtyWire | TcpWire) -> str:
    """The port that a driver opens."""
    return wire.port if isinstance(wire, PtyWire) else f"tcp://{wire.host}:{wire.port}"


EMULATED_STAGES = {kind: partial(emulated, kind) for kind in KINDS}
