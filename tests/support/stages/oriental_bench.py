"""An emulated AZ drive on a wire and the driver before it, for the tests of both."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from drivers.stages.motor_stage import Limits
from drivers.stages.oriental import OrientalSettings, OrientalStage
from instrument.clock import SystemClock
from sim.emulated.modbus_tcp_gateway import ModbusTcpGateway
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.oriental_controller import OrientalController
from sim.emulated.wire import PtyWire, TcpWire

STEPS_PER_DEG = 100.0
LIMITS = Limits(-170.0, 170.0, 2000.0, 100e3, 0.02, 2.0)
FAST = Mechanics(speed_deg_per_s=2000.0, acceleration_deg_per_s2=100e3, homing_s=0.03)
SLOW = Mechanics(speed_deg_per_s=10.0, acceleration_deg_per_s2=1000.0, homing_s=0.03)
SLOW_LIMITS = Limits(-170.0, 170.0, 10.0, 1000.0, 0.02, 2.0)
KINDS = ("pty", "tcp")


@dataclass
class Bench:
    """A wire with one drive on it. `reply_s`: what the driver is told of its time-out."""

    kind: str
    wire: PtyWire | TcpWire
    drive: OrientalController
    limits: Limits
    reply_s: float
    stages: list[OrientalStage] = field(default_factory=list)

    @property
    def motor(self) -> Motor:
        return self.drive.motor

    @property
    def port(self) -> str:
        return port_of(self.wire)

    def open(self, unit: int = 1) -> OrientalStage:
        settings = OrientalSettings(
            self.port, STEPS_PER_DEG, self.limits, parity="N", unit=unit, reply_s=self.reply_s
        )
        self.stages.append(OrientalStage("theta_r", settings, SystemClock()))
        return self.stages[-1]

    def homed(self) -> OrientalStage:
        stage = self.open()
        stage.home()
        return stage

    def sent(self, function_and_register: bytes, since: int = 0) -> list[float]:
        """When requests that contain these bytes came, after the first `since`."""
        return [at for at, data in self.wire.seen[since:] if function_and_register in data]


def port_of(wire: PtyWire | TcpWire) -> str:
    return wire.port if isinstance(wire, PtyWire) else f"tcp://{wire.host}:{wire.port}"


@contextmanager
def bench(
    kind: str, mechanics: Mechanics = FAST, limits: Limits = LIMITS, reply_s: float = 0.25
) -> Iterator[Bench]:
    drive = OrientalController(Motor(mechanics, SystemClock()), steps_per_deg=STEPS_PER_DEG)
    wire: PtyWire | TcpWire
    wire = PtyWire([drive]) if kind == "pty" else TcpWire([ModbusTcpGateway([drive])])
    with wire:
        made = Bench(kind, wire, drive, limits, reply_s)
        try:
            yield made
        finally:
            for stage in made.stages:
                stage.close()
