"""Every stage on simulated time and without a wire: thousands of moves in a second, no thread.

The real drivers talk to their emulated controllers within a call. The watchdog, which lives in real
time, is left out here; it has its own tests.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import cache
from typing import Any
from unittest.mock import patch

from drivers.lines.serial_line import Line
from drivers.stages.newport import NewportStage
from drivers.stages.oriental import OrientalSettings, OrientalStage
from drivers.stages.zaber import ZaberStage
from instrument.config.axes import SimulatedAxis
from instrument.config.load import Loaded, load_protocol
from instrument.devices import Stage
from sim.clock import SimulatedClock
from sim.emulated.motor import Motor
from sim.emulated.newport_controller import NewportController
from sim.emulated.oriental_controller import OrientalController
from sim.emulated.wire import Controller
from sim.emulated.zaber_controller import MICROSTEPS_PER_DEG, ZaberController
from sim.scene.scene import Scene
from sim.scene.stage import SimulatedStage
from tests.support.paths import CONFIGS
from tests.support.stages.emulated_benches import LIMITS, MECHANICS, STEPS_PER_DEG
from tests.support.stages.memory_wire import Unwatched


@dataclass
class Plant:
    """A stage and what is behind it; `motor` is None where stage and motor are one.

    `position_deg` is the truth and not what the stage says; `moves` counts what was begun.
    """

    stage: Stage
    clock: SimulatedClock
    position_deg: Callable[[], float]
    moves: Callable[[], int]
    motor: Motor | None = None
    alarm: str = ""


class _MemoryPort:
    """A serial port whose other end answers within the call."""

    timeout = 0.0

    def __init__(self, controller: Controller) -> None:
        self._controller, self._waiting, self._open = controller, b"", True

    def write(self, data: bytes) -> int:
        self._require_open()
        self._waiting += self._controller.answer(data)
        return len(data)

    def read(self, count: int) -> bytes:
        self._require_open()
        read, self._waiting = self._waiting[:count], self._waiting[count:]
        return read

    @property
    def in_waiting(self) -> int:
        return len(self._waiting)

    def close(self) -> None:
        self._open = False

    def _require_open(self) -> None:
        if not self._open:
            raise OSError("port not open")


class _MemoryUnit:
    """A Modbus unit that is asked within the call; stands in for `ModbusUnit`."""

    where = "memory"

    def __init__(self, drive: OrientalController) -> None:
        self._drive = drive

    def read(self, register: int, count: int, _until_s: float | None = None) -> list[int]:
        answer = self._drive.serve(bytes([3]) + _words(register, count))[2:]
        return [int.from_bytes(answer[n : n + 2], "big") for n in range(0, len(answer), 2)]

    def write(
        self, register: int, values: Sequence[int], _until_s: float, unless: Callable[[], None]
    ) -> None:
        unless()
        count = len(values)
        body = _words(register, count) + bytes([2 * count]) + _words(*values)
        assert self._drive.serve(bytes([16]) + body)[0] == 16, "refused"

    def write_at_once(self, register: int, word: int) -> None:
        assert self._drive.serve(bytes([6]) + _words(register, word))[0] == 6, "refused"


def _words(*values: int) -> bytes:
    return b"".join((value & 0xFFFF).to_bytes(2, "big") for value in values)


@contextmanager
def newport() -> Iterator[Plant]:
    """An SMC100: limits of its own on one side, keeps its reference."""
    with _patched() as (clock, motor):
        controller = NewportController(motor)
        with patch("serial.serial_for_url", lambda *_, **__: _MemoryPort(controller)):
            line = Line("theta_r", "memory", 57600)
        stage = NewportStage("theta_r", line, 1, "SMC100", LIMITS, clock)
        yield _plant(stage, clock, motor, lambda: controller.moves, "0020")


@contextmanager
def zaber() -> Iterator[Plant]:
    """An X-RSW60: limits of its own on one side."""
    with _patched() as (clock, motor):
        controller = ZaberController(motor)
        with patch("serial.serial_for_url", lambda *_, **__: _MemoryPort(controller)):
            line = Line("theta_r", "memory", 115200)
        stage = ZaberStage("theta_r", line, 1, 1, MICROSTEPS_PER_DEG, LIMITS, clock)
        yield _plant(stage, clock, motor, lambda: controller.moves, "FS")


@contextmanager
def oriental() -> Iterator[Plant]:
    """An AZ drive: its own limits cannot be asked for, so the rig file's must be as narrow."""
    with _patched() as (clock, motor):
        drive = OrientalController(motor, steps_per_deg=STEPS_PER_DEG, now_s=clock.now_s)
        limits = replace(LIMITS, max_deg=MECHANICS.max_deg)
        settings = OrientalSettings("memory", STEPS_PER_DEG, limits)
        with patch("drivers.stages.oriental.ModbusUnit", lambda *_: _MemoryUnit(drive)):
            stage = OrientalStage("theta_r", settings, clock, bus=_no_bus())
        yield _plant(stage, clock, motor, lambda: drive.triggers, "30")


@contextmanager
def simulated() -> Iterator[Plant]:
    """The simulated stage; what it begins is seen by where it is."""
    loaded = _demo()
    axis, sample = loaded.rig.axes.theta_r, loaded.protocol.simulated_sample
    assert isinstance(axis, SimulatedAxis)
    assert sample is not None
    clock = SimulatedClock()
    stage = SimulatedStage("theta_r", axis, Scene(loaded.rig, loaded.protocol, sample), clock)
    yield Plant(stage, clock, stage.position_deg, lambda: 0)


@cache
def _demo() -> Loaded:
    return load_protocol(CONFIGS / "protocols" / "demo.yaml")


@contextmanager
def _patched() -> Iterator[tuple[SimulatedClock, Motor]]:
    clock = SimulatedClock()
    with ExitStack() as stack:
        stack.enter_context(patch("drivers.stages.motor_stage.Watchdog", Unwatched))
        yield clock, Motor(MECHANICS, clock)


def _plant(
    stage: Stage, clock: SimulatedClock, motor: Motor, moves: Callable[[], int], alarm: str
) -> Plant:
    return Plant(stage, clock, lambda: motor.position_deg, moves, motor, alarm)


def _no_bus() -> Any:
    """The unit alone is asked."""
    return object()


PLANTS = {"simulated": simulated, "newport": newport, "zaber": zaber, "oriental": oriental}
