"""Limits and status of a stage, and monitors that check the beginning and end of a motion."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

from instrument.errors import DeviceError
from instrument.kinematics import Trapezoid

_ROUNDING = 1e-9
STARTS_WITHIN_S = 0.5  # some controllers still report ready just after the command
STALLED_S = 1.0  # reported as moving, but at the same position
LONG_S = 1.0  # moves of this duration show whether the controller's speed is the rig file's
ASTRAY_DEG = 1.0  # beyond the way of a move: more than overshoot, or an approach from one side
TOO_FAST, TOO_SLOW = 0.9, 1.25  # of the duration that follows from speed and acceleration


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of a stage from the rig file, in the device's own degrees.

    A move may end up to `tolerance_deg` from its target. Homing may take up to `homing_s` and ends
    at `home_deg`.
    """

    min_deg: float
    max_deg: float
    speed_deg_per_s: float
    acceleration_deg_per_s2: float
    tolerance_deg: float
    homing_s: float
    home_deg: float = 0.0

    def at_speed(self, name: str, speed_deg_per_s: float) -> Limits:
        """Return the limits of moves at a speed; raise `DeviceError` above that of these."""
        full = self.speed_deg_per_s
        if not 0 < speed_deg_per_s <= full * (1 + _ROUNDING):
            raise DeviceError(
                f"{name}: {speed_deg_per_s:g} deg/s asked for; allowed: more than 0, up to "
                f"{full:g} deg/s, the rig file's"
            )
        return replace(self, speed_deg_per_s=speed_deg_per_s)


def require_within(name: str, angle_deg: float, limits_deg: tuple[float, float]) -> None:
    """Raise `DeviceError` for an angle past limits, the lower one first; no angle is clipped."""
    low, high = limits_deg
    if not low - _ROUNDING <= angle_deg <= high + _ROUNDING:
        raise DeviceError(
            f"{name}: {angle_deg:g} deg asked for; its limits are {low:g} to {high:g} deg (the "
            "device's own degrees): nothing has moved"
        )


@dataclass(frozen=True, slots=True)
class Status:
    """Status reported by a controller; `fault` is empty or says what to look at."""

    position_deg: float
    moving: bool
    homed: bool
    fault: str = ""


class Monitor(ABC):
    """Judges a motion by each status: has it begun, has it ended, is something wrong.

    `problem` says what is wrong and what to look at, or is empty. One thread at a time calls `see`.
    """

    NEEDS_REFERENCE = True
    """False while the reference is being searched for."""

    def __init__(self, started_s: float) -> None:
        self._started_s = self._sent_s = self._seen_s = started_s
        self._resent = False
        self.begun = self.ended = False
        self.problem = ""

    def sent(self, time_s: float) -> None:
        """Note that the command was sent before a time of the clock: it takes effect from then."""
        self._sent_s = time_s

    def see(self, now: Status, time_s: float) -> None:
        """Take a status into account; `time_s` is a time of the clock just before it."""
        self._seen_s = time_s
        self.begun |= self._shows_motion(now, time_s)
        self.ended = self._at_end(now)
        self.problem = "" if self.ended else self._problem(now, time_s)

    def should_resend(self) -> bool:
        """True once, if the stage should be moving by now and is not."""
        late = not self.begun and self._seen_s - self._sent_s > STARTS_WITHIN_S
        if self._resent or not late:
            return False
        self._resent = True
        return True

    @property
    def may_begin_until_s(self) -> float:
        """Time of the clock until which a motion that has not been seen may still begin."""
        return self._started_s if self.begun else self._sent_s + STARTS_WITHIN_S

    def _never_began(self, time_s: float) -> bool:
        """True once the second command has moved nothing either; the first may have been lost."""
        return not self.begun and self._resent and time_s - self._sent_s > STARTS_WITHIN_S

    @abstractmethod
    def _shows_motion(self, now: Status, time_s: float) -> bool:
        """Return whether a status shows that the motion has begun."""

    @abstractmethod
    def _at_end(self, now: Status) -> bool:
        """Return whether the motion has ended as it should."""

    @abstractmethod
    def _problem(self, now: Status, time_s: float) -> str:
        """Return a description of what is wrong, or an empty text."""


class HomingMonitor(Monitor):
    """Checks that homing begins and ends in time; `again`: the reference was known before."""

    NEEDS_REFERENCE = False

    def __init__(self, allowed_s: float, started_s: float, again: bool) -> None:
        super().__init__(started_s)
        self._allowed_s, self._known = allowed_s, again

    def _shows_motion(self, now: Status, time_s: float) -> bool:
        del time_s
        return now.moving

    def _at_end(self, now: Status) -> bool:
        """Return True once the reference is known and the stage stands."""
        self._known &= now.homed and not now.moving
        return now.homed and not now.moving and not self._known

    def _problem(self, now: Status, time_s: float) -> str:
        where = f", at {now.position_deg:g} deg"
        if self._never_began(time_s):
            return f"did not begin to look for its reference: look at its motor's supply{where}"
        if time_s - self._started_s > self._allowed_s:
            return (
                f"its reference was not found within {self._allowed_s:g} s: look at the reference "
                f"switch, and whether something holds the stage{where}"
            )
        return ""


class MoveMonitor(Monitor):
    """Checks that a move begins, makes progress on its way, and ends in time."""

    def __init__(self, limits: Limits, start: float, target: float, started_s: float) -> None:
        super().__init__(started_s)
        self._limits, self._target = limits, target
        way = Trapezoid(target - start, limits.speed_deg_per_s, limits.acceleration_deg_per_s2)
        self.duration_s = way.duration_s
        self._allowed_s = 1.5 * way.duration_s + 2.0
        self._moved_s = 0.0
        self._start = self._at = start
        self._at_s = started_s

    def _shows_motion(self, now: Status, time_s: float) -> bool:
        if now.moving:
            self._at_s = self._at_s if self.begun else time_s
            self._moved_s = time_s - self._started_s
        return now.moving or abs(now.position_deg - self._start) > self._step_deg

    def _at_end(self, now: Status) -> bool:
        """Return True once the stage stands, unless the move has not begun yet."""
        off_deg = abs(now.position_deg - self._target)
        return not now.moving and (self.begun or off_deg <= self._limits.tolerance_deg)

    def _problem(self, now: Status, time_s: float) -> str:
        if abs(now.position_deg - self._at) > self._step_deg:
            self._at, self._at_s = now.position_deg, time_s
        since_s = time_s - self._sent_s
        where = f"at {now.position_deg:g} deg on the way to {self._target:g} deg"
        if now.homed and self._astray_deg(now.position_deg) > ASTRAY_DEG:
            return (
                f"runs astray, {where} from {self._start:g} deg: look at its encoder, and at what "
                "else commands it, then home it"
            )
        if now.moving and time_s - self._at_s > STALLED_S:
            return f"stalled {where}: look for what holds the stage, then home it"
        if self._never_began(time_s):
            return f"did not begin to move, {where}: look at its motor's supply"
        if self.begun and since_s > self._allowed_s:
            return f"still {where} after {since_s:.1f} s (allowed: {self._allowed_s:.1f} s)"
        return ""

    def _astray_deg(self, at_deg: float) -> float:
        """Return how far beyond the way between start and target a position is, in degrees."""
        low, high = sorted((self._start, self._target))
        return max(low - at_deg, at_deg - high)

    def speed_problem(self, arrived_s: float) -> str:
        """Return a description of a speed that is not the rig file's, or an empty text.

        `arrived_s` is a time of the clock after the status that reported rest: the move took no
        longer than until then, and no less than until the last status that reported motion.
        """
        took_s, least_s = arrived_s - self._started_s, self._moved_s
        if self._resent:
            return ""
        if took_s < TOO_FAST * self.duration_s:
            took = f"{took_s:.2f} s, too fast"
        elif least_s > TOO_SLOW * self.duration_s + STARTS_WITHIN_S:
            took = f"{least_s:.2f} s, too slow"
        else:
            return ""
        return (
            f"moved from {self._start:g} to {self._target:g} deg in {took}: it takes "
            f"{self.duration_s:.2f} s at the rig file's {self._limits.speed_deg_per_s:g} deg/s and "
            f"{self._limits.acceleration_deg_per_s2:g} deg/s2. Look at the controller's units and "
            "speed, then home it: homing sets the speed again"
        )

    @property
    def _step_deg(self) -> float:
        return self._limits.tolerance_deg / 10
