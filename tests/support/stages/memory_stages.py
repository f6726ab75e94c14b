"""Stage drivers over emulated controllers in memory, in simulated time and without a thread.

The drivers' line code runs as it is; the port below it is replaced, so that ten thousand time-outs
take no time. The watchdog runs in real time and is left out; it has tests of its own.
"""

from __future__ import annotations

import logging
import random
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from drivers.stages.motion import Limits
from drivers.stages.motor_stage import MotorStage
from drivers.stages.watchdog import Watchdog
from sim.clock import SimulatedClock
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.wire import Controller
from tests.support.stages.kinds import KINDS, controller_for, open_stage

MECHANICS = Mechanics(
    min_deg=-95.0, max_deg=95.0, speed_deg_per_s=5000.0, acceleration_deg_per_s2=1e6,
    home_deg=0.0, homing_s=0.004,
)  # fmt: skip
LIMITS = Limits(
    min_deg=-90.0, max_deg=90.0, speed_deg_per_s=5000.0, acceleration_deg_per_s2=1e6,
    tolerance_deg=0.01, homing_s=0.5,
)  # fmt: skip
Spoil = Callable[[random.Random, bytes], bytes]
ENDLESS = 100_000  # readings of the clock in one action: it would never return


class CountingClock(SimulatedClock):
    """Simulated clock; a reading takes a microsecond, and too many of them are an error.

    A test sets `readings` to 0 before each action.
    """

    def __init__(self) -> None:
        super().__init__()
        self.readings = 0

    def now_s(self) -> float:
        self.readings += 1
        assert self.readings < ENDLESS, "waits without end"
        self.sleep(1e-6)
        return super().now_s()


class MemoryWire:
    """A controller right behind the driver's port.

    `spoil` turns a genuine answer into what reaches the driver; `heard` is everything that did.
    `spoil_request` turns a request into what reaches the controller; `sent` are all requests.
    """

    def __init__(self, controller: Controller, clock: SimulatedClock) -> None:
        self._controller, self.clock = controller, clock
        self.inbox = b""
        self.spoil: Callable[[bytes], bytes] = lambda answer: answer
        self.spoil_request: Callable[[bytes], bytes] = lambda data: data
        self.sent: list[bytes] = []
        self.heard = bytearray()
        self.genuine: list[bytes] = []

    def open(self, *_: object, **__: object) -> MemoryPort:
        """Stand in for `serial_for_url` and `create_connection`."""
        return MemoryPort(self)

    def request(self, data: bytes) -> None:
        """Pass on a request; the answer is there at once."""
        self.sent.append(data)
        answer = self._controller.answer(self.spoil_request(data))
        if answer:
            self.genuine.append(answer)
            answer = self.spoil(answer)
            self.inbox += answer
            self.heard += answer

    def ready(self, _: int, seconds: float) -> bool:
        """Stand in for select."""
        if not self.inbox:
            self.clock.sleep(seconds)
        return bool(self.inbox)


class MemoryPort:
    """Stands in for pyserial's port and for a socket."""

    timeout = 0.0

    def __init__(self, wire: MemoryWire) -> None:
        self._wire, self._open = wire, True

    def write(self, data: bytes) -> int:
        """Send bytes."""
        self._require_open()
        self._wire.request(bytes(data))
        return len(data)

    send = write

    @property
    def in_waiting(self) -> int:
        """Bytes that have arrived."""
        return len(self._wire.inbox)

    def read(self, size: int = 1) -> bytes:
        """Up to `size` bytes, after the time-out if there are none."""
        self._require_open()
        wire = self._wire
        if not wire.inbox:
            wire.clock.sleep(self.timeout)
        data, wire.inbox = wire.inbox[:size], wire.inbox[size:]
        return data

    recv = read

    def fileno(self) -> int:
        return -1

    def setsockopt(self, *_: int) -> None:
        pass

    def close(self) -> None:
        self._open = False

    def _require_open(self) -> None:
        if not self._open:
            raise OSError("port not open")


class NoWatchdog(Watchdog):
    """Leaves the stage alone: its thread would live in real time."""

    def begin(self) -> None:
        pass


@dataclass
class MemoryStage:
    """A stage's surroundings in memory; `open` opens a new driver on the same wire."""

    clock: CountingClock
    motor: Motor
    wire: MemoryWire
    alarm: str
    moves: Callable[[], int] = field(repr=False)
    limits: Limits
    kind: str

    def open(self) -> MotorStage:
        stage = open_stage(self.kind, _ADDRESS[KINDS[self.kind].tcp], self.limits, self.clock)
        stage.watchdog = NoWatchdog("none", lambda: "", lambda: None, self.clock)
        return stage

    def spoil_next(self, rng: random.Random, spoil: Spoil) -> None:
        """Spoil some of the next answers, and leave all later ones whole."""
        first, count = rng.choice((0, 0, 1, 2, 3, 5)), rng.choice((1, 1, 1, 2, 4, 12))
        coming = [False] * first + [True] * count

        def spoiled(answer: bytes) -> bytes:
            if coming and coming.pop(0):
                return spoil(rng, answer)
            return answer

        self.wire.spoil = spoiled


_ADDRESS = {False: "wire", True: "tcp://gateway:502"}


def in_memory(
    kind: str,
    patch: pytest.MonkeyPatch,
    mechanics: Mechanics = MECHANICS,
    limits: Limits = LIMITS,
) -> MemoryStage:
    """A wire of this kind, whatever port a driver opens while the patch holds."""
    clock = CountingClock()
    motor = Motor(mechanics, clock)
    controller, moves = controller_for(kind, motor, clock)
    wire = MemoryWire(controller, clock)
    # Each repeated query is logged; what a test runner keeps of that is no leak.
    patch.setattr(logging.Logger, "warning", lambda *_: None)
    patch.setattr("serial.serial_for_url", wire.open)
    patch.setattr("socket.create_connection", wire.open)
    patch.setattr("drivers.lines.modbus_client._ready", wire.ready)
    return MemoryStage(clock, motor, wire, KINDS[kind].alarm, moves, limits, kind)
