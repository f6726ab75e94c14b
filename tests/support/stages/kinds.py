"""Kinds of motor stages for the tests: each one's emulated controller, and its driver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from drivers.lines.modbus_bus import ModbusBus
from drivers.lines.modbus_client import BusSettings
from drivers.lines.serial_line import Line
from drivers.stages.motion import Limits
from drivers.stages.motor_stage import MotorStage
from drivers.stages.newport import NewportStage
from drivers.stages.oriental import OrientalStage
from drivers.stages.zaber import ZaberStage
from instrument.clock import Clock, SystemClock
from sim.emulated.motor import Motor
from sim.emulated.newport_controller import NewportController
from sim.emulated.oriental_controller import OrientalController
from sim.emulated.wire import Controller
from sim.emulated.zaber_controller import MICROSTEPS_PER_DEG, ZaberController
from tests.support.stages.modbus_tcp_gateway import ModbusTcpGateway

STEPS_PER_DEG = 1000.0


@dataclass(frozen=True)
class Kind:
    """One kind of stage, as far as the tests of all stages need to know it.

    name: a word of its identity. alarm, at_limit: a fault, and that of a limit switch, in the
    controller's own code as `Motor.fail` takes it. stop: bytes that occur only in its stop command.
    tcp: behind a gateway. keeps_limits: the controller has limits of its own that can be read.
    full_duplex: a stop need not wait for an answer that is pending.
    """

    name: str
    alarm: str
    at_limit: str
    stop: bytes
    tcp: bool = False
    keeps_limits: bool = True
    full_duplex: bool = True


_AZ = Kind(
    name="AZ", alarm="30", at_limit="66", stop=bytes.fromhex("06007D0020"),
    keeps_limits=False, full_duplex=False,
)  # fmt: skip
KINDS = {
    "newport": Kind(name="SMC100", alarm="0020", at_limit="0001", stop=b"1ST"),
    "zaber": Kind(name="Zaber", alarm="FS", at_limit="FE", stop=b" stop:"),
    "oriental rtu": _AZ,
    "oriental tcp": replace(_AZ, tcp=True),
}
SERIAL = tuple(name for name, kind in KINDS.items() if not kind.tcp)
"""Kinds on a serial line of their own."""


def controller_for(kind: str, motor: Motor, clock: Clock) -> tuple[Controller, Callable[[], int]]:
    """Return a controller as it appears on the wire, and its count of moves begun."""
    if kind == "newport":
        newport = NewportController(motor)
        return newport, lambda: newport.moves
    if kind == "zaber":
        zaber = ZaberController(motor)
        return zaber, lambda: zaber.moves
    drive = OrientalController(motor, steps_per_deg=STEPS_PER_DEG, now_s=clock.now_s)
    return ModbusTcpGateway([drive]) if KINDS[kind].tcp else drive, lambda: drive.triggers


def open_stage(kind: str, port: str, limits: Limits, clock: Clock) -> MotorStage:
    """Open the driver on a port."""
    if kind == "newport":
        line = Line("theta_r", port, 57600, clock)
        return NewportStage("theta_r", line, 1, "SMC100", limits, clock)
    if kind == "zaber":
        line = Line("theta_r", port, 115200, clock)
        return ZaberStage("theta_r", line, 1, 1, MICROSTEPS_PER_DEG, limits, clock)
    return AzStage(BusSettings(port, parity="N"), limits, clock, steps_per_deg=STEPS_PER_DEG)


class AzStage(OrientalStage):
    """AZ drive on a line of its own, which is closed with the stage."""

    def __init__(
        self,
        settings: BusSettings,
        limits: Limits,
        clock: Clock | None = None,
        unit: int = 1,
        steps_per_deg: float = 100.0,
    ) -> None:
        clock = clock or SystemClock()
        self.bus = ModbusBus("theta_r", settings, clock)
        try:
            super().__init__("theta_r", self.bus, unit, steps_per_deg, limits, clock)
        except BaseException:
            self.bus.close()
            raise

    def close(self) -> None:
        super().close()
        self.bus.close()
