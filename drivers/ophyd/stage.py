"""Motor of ophyd-async as the stage of an axis: EPICS, or whatever else has such a class.

The order of a move, the limits, the watchdog and the verified stop are those of all motor stages.
The motor must know its reference and count in degrees; it is homed in its own control system.
"""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any

from drivers.ophyd.event_loop import EventLoop
from drivers.stages.motion import Limits, Status
from drivers.stages.motor_stage import MotorStage
from instrument.clock import Clock
from instrument.errors import DeviceError

CONNECTS_WITHIN_S = 10.0
REPLY_S = 0.3  # of a control system on a network
_DEGREES = ("deg", "degs", "degree", "degrees", "°")
_STILL = 0.1  # share of the tolerance by which the position of a motor at rest may change


class OphydStage(MotorStage):
    """A motor by its class in Python, `module:Class`, and the prefix of its address, if any."""

    KEEPS_REFERENCE = True

    def __init__(
        self, name: str, motor: str, prefix: str | None, limits: Limits, clock: Clock
    ) -> None:
        kind = motor_class(name, motor)
        self._loop = EventLoop(name)
        super().__init__(name, limits, clock, self._loop, REPLY_S)
        self._what = motor if prefix is None else f"{motor} at {prefix}"
        self._move: Any = None
        self._last_deg = math.nan
        try:
            self._motor = self._run("connection", _connected(kind, prefix, name), CONNECTS_WITHIN_S)
            self._require_degrees()
        except DeviceError:
            self._loop.close()
            raise

    def identity(self) -> str:
        """Return the motor's class and the prefix of its address."""
        return f"ophyd-async motor {self._what}"

    def status(self, retry: bool = True) -> Status:
        """Read the position; with `retry` it may take twice as long."""
        within_s = 2 * REPLY_S if retry else REPLY_S
        pending = self._move is not None and not self._move.done  # first: it may end just now
        read = self._motor.movable_logic.readback.get_value()
        at_deg = float(self._run("position", read, within_s))
        drifts = abs(at_deg - self._last_deg) > _STILL * self._limits.tolerance_deg
        self._last_deg = at_deg
        return Status(at_deg, moving=pending or drifts, homed=True, fault=self._fault())

    def _fault(self) -> str:
        """Return why the last move failed; a stop and the next move forget it."""
        move = self._move
        if move is None or not move.done or move.success or self._stopped:
            return ""
        return f"its move failed: {move.exception()}: look at its control system"

    def _own_limits_deg(self) -> tuple[float, float]:
        return -math.inf, math.inf  # the motor refuses a move beyond its own

    def _own_settings(self) -> dict[str, str]:
        return {"motor": self._what}

    def _send_home(self) -> None:
        raise DeviceError(f"{self.name}: home it in its own control system")

    def _apply_speed(self) -> None:
        velocity = getattr(self._motor, "velocity", None)
        if velocity is not None:
            self._run("speed", _finished(velocity, self._limits.speed_deg_per_s))

    def start_move(self, angle_deg: float) -> None:
        """Start a move; what became of the one before does not count any more."""
        if self._move is not None and self._move.done:
            self._move = None
        super().start_move(angle_deg)

    def _send_move(self, angle_deg: float) -> None:
        self._move = self._run(f"move to {angle_deg:g} deg", _begun(self._motor, angle_deg))

    def _send_stop(self) -> None:
        self._run("stop", self._motor.stop(success=True))  # else its error is told to nobody
        if self._move is not None and self._move.done:
            self._move = None

    def _run(self, what: str, coroutine: Any, within_s: float = REPLY_S) -> Any:
        return self._loop.run(what, coroutine, within_s)

    def _require_degrees(self) -> None:
        unit, _ = self._run("unit", self._motor.movable_logic.get_units_precision())
        if str(unit).strip().lower() not in _DEGREES:
            raise DeviceError(
                f"{self.name}: {self._what} counts in {unit!r}; allowed: a motor that counts in "
                "degrees ('deg'): set its unit in its control system"
            )


def motor_class(name: str, path: str) -> type[Any]:
    """Return the class of a motor, `module:Class`; raise `DeviceError` for anything else."""
    try:
        from ophyd_async.core import StandardMovable
    except ImportError:
        raise DeviceError(
            f"{name}: driver ophyd: ophyd-async is not installed: pip install 'gonio[ophyd]'"
        ) from None
    module, _, own = path.partition(":")
    try:
        found = getattr(import_module(module), own)
    except (ImportError, AttributeError) as error:
        raise DeviceError(
            f"{name}: motor: {path}: {error}; allowed: module:Class that Python can import"
        ) from error
    if not (isinstance(found, type) and issubclass(found, StandardMovable)):
        raise DeviceError(
            f"{name}: motor: {path}: is no motor; allowed: a class derived from StandardMovable of "
            "ophyd-async, such as ophyd_async.epics.motor:Motor"
        )
    return found


async def _connected(kind: type[Any], prefix: str | None, name: str) -> Any:
    motor = kind() if prefix is None else kind(prefix)
    motor.set_name(name)
    await motor.connect(timeout=CONNECTS_WITHIN_S)
    return motor


async def _begun(motor: Any, angle_deg: float) -> Any:
    return motor.set(angle_deg)


async def _finished(signal: Any, value: float) -> None:
    await signal.set(value)
