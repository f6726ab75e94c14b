"""What all motor stages share: limits before a byte is sent, homing first, checked positions.

A driver says how its controller is asked and told; when a move has begun and ended, what counts as
a stall and when a stop is sent is written here, once.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from instrument.clock import Clock
from instrument.errors import DeviceError
from instrument.kinematics import Trapezoid

POLL_S = 0.005
STARTS_WITHIN_S = 0.5  # some controllers still say ready just after the command
STALLED_S = 1.0  # said to move, but at the same place
_ROUNDING_DEG = 1e-9


class Stopped(DeviceError):
    """The motion was stopped before it reached its end."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What a stage may do, in the device's own degrees: the rig file's and its maker's numbers.

    `tolerance_deg`: how far from the target a move may end. `homing_s`: how long finding the
    reference may take.
    """

    min_deg: float
    max_deg: float
    speed_deg_per_s: float
    acceleration_deg_per_s2: float
    tolerance_deg: float
    homing_s: float


@dataclass(frozen=True, slots=True)
class Status:
    """What a controller says of itself; `fault` is empty or says what to look at."""

    position_deg: float
    moving: bool
    homed: bool
    fault: str = ""


class MotorStage(ABC):
    """A stage behind a controller. Angles are the device's own degrees."""

    def __init__(self, name: str, limits: Limits, clock: Clock) -> None:
        self.name, self._limits, self._clock = name, limits, clock
        self._target_deg: float | None = None
        self._from_deg = 0.0
        self._started_s = 0.0
        self._stopped = False

    # What a driver says: how its controller is asked and told.

    @abstractmethod
    def identity(self) -> str:
        """Who answers: maker, model, serial number."""

    @abstractmethod
    def status(self) -> Status:
        """Where the stage is and what it does."""

    @abstractmethod
    def close(self) -> None:
        """Let go of the line; safe twice."""

    @abstractmethod
    def _own_limits_deg(self) -> tuple[float, float]:
        """The limits that the controller itself keeps; infinite where it keeps none."""

    @abstractmethod
    def _send_home(self) -> None:
        """Have the controller look for its reference."""

    @abstractmethod
    def _send_move(self, angle_deg: float) -> None:
        """Have it move; returns when the controller is known to have taken the command."""

    @abstractmethod
    def _send_stop(self) -> None:
        """End all motion, before whatever waits for the line."""

    # What the program asks for.

    def limits_deg(self) -> tuple[float, float]:
        """The narrower of the rig file's limits and the controller's."""
        low, high = self._own_limits_deg()
        return max(low, self._limits.min_deg), min(high, self._limits.max_deg)

    def position_deg(self) -> float:
        """Where the stage is."""
        return self.status().position_deg

    def home(self) -> None:
        """Find the reference."""
        self._refuse_fault(self.status())
        self._stopped, self._target_deg = False, None
        self._send_home()
        self._stop_if_stopped()
        begun_s = self._clock.now_s()
        while not self._at_home(self.status()):
            if self._clock.now_s() - begun_s > self._limits.homing_s:
                self.stop()
                raise DeviceError(
                    f"{self.name}: its reference was not found within {self._limits.homing_s:g} s: "
                    "look at the reference switch, and whether something holds the stage"
                )
            self._clock.sleep(POLL_S)

    def start_move(self, angle_deg: float) -> None:
        """Begin to move; refused before homing, past a limit, and while the controller has a fault.

        Nothing is sent then.
        """
        low, high = self.limits_deg()
        if not low - _ROUNDING_DEG <= angle_deg <= high + _ROUNDING_DEG:
            raise DeviceError(
                f"{self.name}: {angle_deg:g} deg asked for; its limits are {low:g} to {high:g} deg "
                "(the device's own degrees): nothing has moved"
            )
        now = self.status()
        self._refuse_fault(now)
        if not now.homed:
            raise DeviceError(f"{self.name}: not homed, so it must not move: home it first")
        self._stopped = False
        self._from_deg, self._target_deg = now.position_deg, angle_deg
        self._started_s = self._clock.now_s()
        self._send_move(angle_deg)
        self._stop_if_stopped()

    def wait(self) -> float:
        """Wait until the move has ended; returns where, in degrees, which must be the target."""
        if self._target_deg is None:
            return self.position_deg()
        watch = _Watch(self._limits, self._from_deg, self._target_deg, self._started_s)
        while True:
            now = self.status()
            self._refuse_stop(now)
            self._refuse_fault(now)
            wrong = watch.wrong(now, self._clock.now_s())
            if wrong:
                self.stop()
                raise DeviceError(f"{self.name}: {wrong}")
            if watch.ended(now):
                return self._arrived(now)
            self._clock.sleep(POLL_S)

    def stop(self) -> None:
        """End all motion now; safe at any time, twice, and from another thread."""
        self._stopped = True
        self._send_stop()

    def _at_home(self, now: Status) -> bool:
        self._refuse_stop(now)
        self._refuse_fault(now)
        return now.homed and not now.moving

    def _arrived(self, now: Status) -> float:
        target, self._target_deg = self._target_deg, None
        if target is not None and abs(now.position_deg - target) > self._limits.tolerance_deg:
            raise DeviceError(
                f"{self.name}: stands at {now.position_deg:g} deg instead of {target:g} deg "
                f"(allowed: {self._limits.tolerance_deg:g} deg off): look for what holds the "
                "stage, then home it"
            )
        return now.position_deg

    def _stop_if_stopped(self) -> None:
        """A stop that came while the command was on its way must not be overtaken by it."""
        if self._stopped:
            self._send_stop()
            raise Stopped(f"{self.name}: stopped as it was about to move")

    def _refuse_stop(self, now: Status) -> None:
        if self._stopped:
            self._target_deg = None
            raise Stopped(f"{self.name}: stopped at {now.position_deg:g} deg")

    def _refuse_fault(self, now: Status) -> None:
        if now.fault:
            self._target_deg = None
            raise DeviceError(f"{self.name}: {now.fault}")


class _Watch:
    """Whether a move goes as it should: it begins, gets on, and ends in time."""

    def __init__(self, limits: Limits, start: float, target: float, started_s: float) -> None:
        self._limits, self._target, self._started_s = limits, target, started_s
        way = Trapezoid(target - start, limits.speed_deg_per_s, limits.acceleration_deg_per_s2)
        self._allowed_s = 1.5 * way.duration_s + 2.0
        self._at, self._at_s = start, started_s
        self._begun = False

    def ended(self, now: Status) -> bool:
        """No longer moving, and not because it has not begun yet."""
        return not now.moving and (self._begun or self._there(now))

    def wrong(self, now: Status, time_s: float) -> str:
        """What is wrong with the move, or nothing."""
        self._begun |= now.moving
        if abs(now.position_deg - self._at) > self._limits.tolerance_deg / 10:
            self._at, self._at_s = now.position_deg, time_s
        since_s = time_s - self._started_s
        where = f"at {now.position_deg:g} deg on the way to {self._target:g} deg"
        if now.moving and time_s - self._at_s > STALLED_S:
            return f"stalled {where}: look for what holds the stage, then home it"
        if since_s > self._allowed_s:
            return f"still {where} after {since_s:.1f} s (allowed: {self._allowed_s:.1f} s)"
        if (
            not now.moving
            and not self._begun
            and since_s > STARTS_WITHIN_S
            and not self._there(now)
        ):
            return f"did not begin to move, {where}: look at its motor's supply"
        return ""

    def _there(self, now: Status) -> bool:
        return abs(now.position_deg - self._target) <= self._limits.tolerance_deg
