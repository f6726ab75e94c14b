"""Controllers on a wire that is only memory, in a time that is only a number.

The drivers' own line code runs as it is: what is replaced is the port under it and the clock beside
it, so that ten thousand time-outs take no time.
"""

from __future__ import annotations

import logging
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime

import pytest

from drivers.lines.serial_line import Line
from drivers.stages.motor_stage import Limits, MotorStage
from drivers.stages.newport import NewportStage
from drivers.stages.oriental import OrientalSettings, OrientalStage
from drivers.stages.watchdog import Watchdog
from drivers.stages.zaber import ZaberStage
from sim.emulated.modbus_tcp_gateway import ModbusTcpGateway
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.newport_controller import NewportController
from sim.emulated.oriental_controller import OrientalController
from sim.emulated.wire import Controller
from sim.emulated.zaber_controller import MICROSTEPS_PER_DEG, ZaberController

STEPS_PER_DEG = 1000.0
MECHANICS = Mechanics(
    min_deg=-95.0, max_deg=95.0, speed_deg_per_s=5000.0, acceleration_deg_per_s2=1e6,
    home_deg=0.0, homing_s=0.004,
)  # fmt: skip
LIMITS = Limits(
    min_deg=-90.0, max_deg=90.0, speed_deg_per_s=5000.0, acceleration_deg_per_s2=1e6,
    tolerance_deg=0.01, homing_s=0.5,
)  # fmt: skip
Spoil = Callable[[random.Random, bytes], bytes]
ENDLESS = 100_000  # looks at the clock by one action: it would never come back


class FakeTime:
    """Stands in for the clock and for the module `time`: only waiting makes it go on."""

    def __init__(self) -> None:
        self._now_s = 1000.0
        self.looks = 0

    def now_s(self) -> float:
        """The time; a look at it takes a microsecond, and there must be an end of looking."""
        self.looks += 1
        assert self.looks < ENDLESS, "waits without end"
        self._now_s += 1e-6
        return self._now_s

    monotonic = now_s

    def utc(self) -> datetime:
        """Some date."""
        return datetime.fromtimestamp(self.now_s(), UTC)

    def sleep(self, seconds: float) -> None:
        """Let time pass."""
        self._now_s += max(0.0, seconds)


class MemoryPort:
    """What pyserial's port and a socket are to the drivers, with a controller right behind it.

    `spoil` makes of a genuine answer what reaches the driver; `heard` is all that did.
    """

    timeout = 0.0

    def __init__(self, controller: Controller, clock: FakeTime) -> None:
        self._controller, self._clock = controller, clock
        self._inbox = b""
        self.spoil: Callable[[bytes], bytes] = lambda answer: answer
        self.heard = bytearray()
        self.genuine: list[bytes] = []

    def write(self, data: bytes) -> int:
        """Ask; the answer is there at once."""
        answer = self._controller.answer(bytes(data))
        if answer:
            self.genuine.append(answer)
            answer = self.spoil(answer)
            self._inbox += answer
            self.heard += answer
        return len(data)

    send = write

    @property
    def in_waiting(self) -> int:
        """Bytes that have come."""
        return len(self._inbox)

    def read(self, size: int = 1) -> bytes:
        """Up to `size` bytes, after the time-out if there are none."""
        if not self._inbox:
            self._clock.sleep(self.timeout)
        data, self._inbox = self._inbox[:size], self._inbox[size:]
        return data

    recv = read

    def ready(self, _: int, seconds: float) -> bool:
        """In place of select."""
        if not self._inbox:
            self._clock.sleep(seconds)
        return bool(self._inbox)

    def fileno(self) -> int:
        """No descriptor."""
        return -1

    def setsockopt(self, *_: int) -> None:
        """Nothing to set."""

    def close(self) -> None:
        """Nothing to let go of."""


@dataclass
class MemoryBench:
    """A stage on a wire of memory; `open` makes the driver anew on the same wire."""

    clock: FakeTime
    motor: Motor
    port: MemoryPort
    open: Callable[[], MotorStage]
    moves: Callable[[], int] = field(repr=False)

    def spoil_next(self, rng: random.Random, spoil: Spoil) -> None:
        """Spoil some of the next answers, and leave all later ones whole."""
        first, count = rng.choice((0, 0, 1, 2, 3, 5)), rng.choice((1, 1, 1, 2, 4, 12))
        coming = [False] * first + [True] * count

        def spoiled(answer: bytes) -> bytes:
            if coming and coming.pop(0):
                return spoil(rng, answer)
            return answer

        self.port.spoil = spoiled


class Unwatched(Watchdog):
    """The watchdog lives in real time, of which nothing goes by here."""

    def begin(self) -> None:
        """Nothing to watch."""


def bench(kind: str, patch: pytest.MonkeyPatch) -> MemoryBench:
    """A wire of this kind: newport, zaber, oriental rtu or oriental tcp."""
    clock = FakeTime()
    motor = Motor(MECHANICS, clock)
    controller = _controller(kind, motor, clock)
    answering = ModbusTcpGateway([controller]) if kind == "oriental tcp" else controller
    port = MemoryPort(answering, clock)
    lines = ("lines.serial_line", "lines.modbus_bus", "lines.modbus_client")
    for module in (*lines, "stages.oriental"):
        patch.setattr(f"drivers.{module}.time", clock)
    patch.setattr("drivers.stages.motor_stage.Watchdog", Unwatched)
    # Each question that is asked again is logged; what a test runner keeps of that is no leak.
    patch.setattr(logging.Logger, "warning", lambda *_: None)
    patch.setattr("serial.serial_for_url", lambda *_, **__: port)
    patch.setattr("socket.create_connection", lambda *_, **__: port)
    patch.setattr("drivers.lines.modbus_client._ready", port.ready)
    moves = (lambda: controller.triggers) if "oriental" in kind else (lambda: controller.moves)
    return MemoryBench(clock, motor, port, lambda: _open(kind, clock), moves)


def _controller(
    kind: str, motor: Motor, clock: FakeTime
) -> NewportController | ZaberController | OrientalController:
    if kind == "newport":
        return NewportController(motor)
    if kind == "zaber":
        return ZaberController(motor)
    return OrientalController(motor, steps_per_deg=STEPS_PER_DEG, now_s=clock.now_s)


def _open(kind: str, clock: FakeTime) -> MotorStage:
    if kind == "newport":
        return NewportStage("theta_r", Line("theta_r", "wire", 57600), 1, "SMC100", LIMITS, clock)
    if kind == "zaber":
        line = Line("theta_r", "wire", 115200)
        return ZaberStage("theta_r", line, 1, 1, MICROSTEPS_PER_DEG, LIMITS, clock)
    port = "tcp://gateway:502" if kind == "oriental tcp" else "wire"
    settings = OrientalSettings(port, STEPS_PER_DEG, LIMITS, parity="N")
    return OrientalStage("theta_r", settings, clock)
