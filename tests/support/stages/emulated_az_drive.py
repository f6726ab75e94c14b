"""Emulated AZ drive on a wire, and the driver that opens it, for the tests of both."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

from drivers.lines.modbus_client import BusSettings
from drivers.stages.motion import Limits
from instrument.clock import SystemClock
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.oriental_controller import OrientalController
from sim.emulated.wire import PtyWire
from tests.support.stages.emulated_stages import port_of
from tests.support.stages.kinds import AzStage
from tests.support.stages.modbus_tcp_gateway import ModbusTcpGateway, TcpWire

STEPS_PER_DEG = 100.0
LIMITS = Limits(
    min_deg=-170.0, max_deg=170.0, speed_deg_per_s=2000.0, acceleration_deg_per_s2=100e3,
    tolerance_deg=0.02, homing_s=2.0,
)  # fmt: skip
SLOW_LIMITS = replace(LIMITS, speed_deg_per_s=10.0, acceleration_deg_per_s2=1000.0)
FAST = Mechanics(speed_deg_per_s=2000.0, acceleration_deg_per_s2=100e3, homing_s=0.03)
SLOW = Mechanics(speed_deg_per_s=10.0, acceleration_deg_per_s2=1000.0, homing_s=0.03)
WIRES = ("pty", "tcp")

# The maker's example: direct operation to 8500 steps at 2000 Hz, 1.5 kHz/s.
MAKERS_EXAMPLE = bytes.fromhex(
    "01 10 0058 0010 20 00000000 00000001 00002134 000007D0 000005DC 000005DC 000003E8 00000001E343"
)


@dataclass
class EmulatedDrive:
    """A wire with one drive on it. `reply_s`: time-out given to the driver."""

    wire: PtyWire | TcpWire
    drive: OrientalController
    limits: Limits
    reply_s: float
    stages: list[AzStage] = field(default_factory=list)

    @property
    def motor(self) -> Motor:
        return self.drive.motor

    @property
    def port(self) -> str:
        return port_of(self.wire)

    def open(self, unit: int = 1) -> AzStage:
        settings = BusSettings(self.port, parity="N", reply_s=self.reply_s)
        self.stages.append(AzStage(settings, self.limits, unit=unit))
        return self.stages[-1]

    def homed(self) -> AzStage:
        stage = self.open()
        stage.home()
        return stage

    def sent(self, function_and_register: bytes, since: int = 0) -> list[float]:
        """Times of requests that contain these bytes, after the first `since`."""
        return [at for at, data in self.wire.seen[since:] if function_and_register in data]


@contextmanager
def emulated_drive(
    wire_kind: str, mechanics: Mechanics = FAST, limits: Limits = LIMITS, reply_s: float = 0.25
) -> Iterator[EmulatedDrive]:
    """A drive on a pseudo-terminal ("pty"), or behind a gateway ("tcp")."""
    drive = OrientalController(Motor(mechanics, SystemClock()), steps_per_deg=STEPS_PER_DEG)
    wire: PtyWire | TcpWire
    wire = PtyWire([drive]) if wire_kind == "pty" else TcpWire([ModbusTcpGateway([drive])])
    with wire:
        made = EmulatedDrive(wire, drive, limits, reply_s)
        try:
            yield made
        finally:
            for stage in made.stages:
                stage.close()
