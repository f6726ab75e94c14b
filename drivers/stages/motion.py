"""Limits and status of a stage, and monitors that check the beginning and end of a motion."""

from __future__ import annotations

from dataclasses import dataclass

from instrument.kinematics import Trapezoid

STARTS_WITHIN_S = 0.5  # some controllers still report ready just after the command
STALLED_S = 1.0  # reported as moving, but at the same position
LONG_S = 1.0  # moves of this duration show whether the controller's speed is the rig file's
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


@dataclass(frozen=True, slots=True)
class Status:
    """Status reported by a controller; `fault` is empty or says what to look at."""

    position_deg: float
    moving: bool
    homed: bool
    fault: str = ""


class _Monitor:
    """Checks that a motion begins, or that its command is sent again."""

    def __init__(self, started_s: float) -> None:
        self._started_s = started_s
        self._begun = self._resent = False

    def should_resend(self, time_s: float) -> bool:
        """True once, if the stage should be moving by now and is not."""
        late = not self._begun and not self._resent and time_s - self._started_s > STARTS_WITHIN_S
        self._resent |= late
        return late


class HomingMonitor(_Monitor):
    """Checks that homing begins and ends in time; `again`: the reference was known before."""

    def __init__(self, allowed_s: float, started_s: float, again: bool) -> None:
        super().__init__(started_s)
        self._allowed_s, self._known = allowed_s, again

    def ended(self, now: Status) -> bool:
        """True once the reference is known and the stage stands."""
        self._begun |= now.moving
        self._known &= now.homed and not now.moving
        return now.homed and not now.moving and not self._known

    def problem(self, time_s: float) -> str:
        """Return a description of what is wrong, or an empty text."""
        since_s = time_s - self._started_s
        if not self._begun and since_s > 2 * STARTS_WITHIN_S:
            return "did not begin to look for its reference: look at its motor's supply"
        if since_s > self._allowed_s:
            return (
                f"its reference was not found within {self._allowed_s:g} s: look at the reference "
                "switch, and whether something holds the stage"
            )
        return ""


class MoveMonitor(_Monitor):
    """Checks that a move begins, makes progress, and ends in time."""

    def __init__(self, limits: Limits, start: float, target: float, started_s: float) -> None:
        super().__init__(started_s)
        self._limits, self._target = limits, target
        way = Trapezoid(target - start, limits.speed_deg_per_s, limits.acceleration_deg_per_s2)
        self.duration_s = way.duration_s
        self._allowed_s = 1.5 * way.duration_s + 2.0
        self._moved_s = 0.0
        self._start = self._at = start
        self._at_s = started_s

    def ended(self, now: Status, time_s: float) -> bool:
        """True once the stage stands, unless the move has not begun yet.

        `time_s` is a time just before the status.
        """
        self._begun |= now.moving or abs(now.position_deg - self._start) > self._step_deg
        if now.moving:
            self._moved_s = time_s - self._started_s
        off_deg = abs(now.position_deg - self._target)
        return not now.moving and (self._begun or off_deg <= self._limits.tolerance_deg)

    def problem(self, now: Status, time_s: float) -> str:
        """Return a description of what is wrong with the move, or an empty text."""
        if abs(now.position_deg - self._at) > self._step_deg:
            self._at, self._at_s = now.position_deg, time_s
        since_s = time_s - self._started_s
        where = f"at {now.position_deg:g} deg on the way to {self._target:g} deg"
        if now.moving and time_s - self._at_s > STALLED_S:
            return f"stalled {where}: look for what holds the stage, then home it"
        if not self._begun and since_s > 2 * STARTS_WITHIN_S:
            return f"did not begin to move, {where}: look at its motor's supply"
        if since_s > self._allowed_s:
            return f"still {where} after {since_s:.1f} s (allowed: {self._allowed_s:.1f} s)"
        return ""

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
