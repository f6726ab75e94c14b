"""What all motor stages share: limits before a byte is sent, homing first, checked positions.

A driver says how its controller is asked and told; when a move has begun and ended, what counts as
a stall and when a stop is sent is written here, once.
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from dataclasses import dataclass

from drivers.stages.watchdog import SILENT_S, Watchdog
from instrument.clock import Clock
from instrument.errors import DeviceError
from instrument.kinematics import Trapezoid

log = logging.getLogger(__name__)

POLL_S = 0.005
STARTS_WITHIN_S = 0.5  # some controllers still say ready just after the command
STALLED_S = 1.0  # said to move, but at the same place
_ROUNDING_DEG = 1e-9
_UNHEARD = f"no status for {SILENT_S:g} s while it moved, so it was told to stop"


class Stopped(DeviceError):
    """The motion was stopped before it reached its end."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What a stage may do, in the device's own degrees: the rig file's and its maker's numbers.

    `tolerance_deg`: how far from the target a move may end. `homing_s`: how long finding the
    reference may take, `home_deg` where the stage stands then.
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
    """What a controller says of itself; `fault` is empty or says what to look at."""

    position_deg: float
    moving: bool
    homed: bool
    fault: str = ""


class MotorStage(ABC):
    """A stage behind a controller. Angles are the device's own degrees."""

    KEEPS_REFERENCE = False
    """Whether a controller that has its reference refuses to look for it again."""

    def __init__(self, name: str, limits: Limits, clock: Clock) -> None:
        self.name, self._limits, self._clock = name, limits, clock
        self._target_deg: float | None = None
        self._from_deg = 0.0
        self._started_s = 0.0
        self._stopped = False
        self._watchdog = Watchdog(name, self._glanced, self._give_up)

    # What a driver says: how its controller is asked and told.

    @abstractmethod
    def identity(self) -> str:
        """Who answers: maker, model, serial number."""

    @abstractmethod
    def status(self, patient: bool = True) -> Status:
        """Where the stage is and what it does; not `patient`: no question is asked again."""

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
    def _apply_speed(self) -> None:
        """Tell a controller that keeps its speed what the rig file says; after homing."""

    @abstractmethod
    def _send_move(self, angle_deg: float) -> None:
        """Have it move, once. Where the answer is lost, the stage's own state tells."""

    @abstractmethod
    def _send_stop(self) -> None:
        """End all motion, before whatever waits for the line."""

    def _own_settings(self) -> dict[str, str]:
        """What the controller says that it is set to, beside its limits."""
        return {}

    # What the program asks for.

    def homed(self) -> bool:
        """Whether the controller knows its reference, asked once the stage has come to rest."""
        return self._at_rest(self.status()).homed

    def _at_rest(self, now: Status) -> Status:
        """The status once a stage that was stopped has come to rest."""
        ramp_s = self._limits.speed_deg_per_s / self._limits.acceleration_deg_per_s2
        until_s = self._clock.now_s() + ramp_s + STALLED_S
        while now.moving:
            if self._clock.now_s() > until_s:
                raise DeviceError(
                    f"{self.name}: still moves {ramp_s + STALLED_S:.1f} s after it was stopped: "
                    "cut its power, then look at its controller"
                )
            self._clock.sleep(POLL_S)
            now = self.status()
        return now

    def _standing(self) -> Status:
        """The status of a stage that may be told to move: one that moves is left alone."""
        now = self.status()
        if now.moving and not self._stopped:
            raise DeviceError(
                f"{self.name}: is on its way already, at {now.position_deg:g} deg: wait for its "
                "end, or stop it first"
            )
        return self._at_rest(now)

    def settings(self) -> dict[str, str]:
        """The limits that hold, and what the controller says that it is set to."""
        low, high = self.limits_deg()
        return {"limits_deg": f"{low:g} to {high:g}", **self._own_settings()}

    def limits_deg(self) -> tuple[float, float]:
        """The narrower of the rig file's limits and the controller's."""
        low, high = self._own_limits_deg()
        return max(low, self._limits.min_deg), min(high, self._limits.max_deg)

    def position_deg(self) -> float:
        """Where the stage is. Before homing nobody knows, whatever the controller counts.

        Nor while its controller has a fault: a motor that was let go may stand anywhere.
        """
        now = self.status()
        self._refuse_fault(now)
        if not now.homed and not now.moving:
            raise DeviceError(
                f"{self.name}: not homed, so its position is not known: home it first"
            )
        return now.position_deg

    def home(self) -> None:
        """Find the reference and stand at home; a controller that keeps it only goes there."""
        now = self._standing()
        self._refuse_fault(now)
        if now.homed and self.KEEPS_REFERENCE:
            self._apply_speed()
            self.start_move(self._limits.home_deg)
            self.wait()
            return
        self._look_for_reference(again=now.homed)
        self._apply_speed()

    def _look_for_reference(self, again: bool) -> None:
        self._stopped, self._target_deg = False, None
        self._watchdog.begin()
        try:
            self._watch_homing(again)
        finally:
            self._watchdog.end()

    def _watch_homing(self, again: bool) -> None:
        self._send_home()
        self._stop_if_stopped()
        watch = _Homing(self._limits.homing_s, self._clock.now_s(), again)
        while not watch.ended(now := self._looked()):
            if watch.not_begun(self._clock.now_s()):
                log.warning("%s: stands still: told again to look for its reference", self.name)
                self._send_home()  # it stands and has no reference: the command never arrived
            wrong = watch.wrong(self._clock.now_s())
            if wrong:
                self.stop()
                raise DeviceError(f"{self.name}: {wrong}, at {now.position_deg:g} deg")
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
        now = self._standing()
        self._refuse_fault(now)
        if not now.homed:
            raise DeviceError(f"{self.name}: not homed, so it must not move: home it first")
        self._stopped = False
        self._from_deg, self._target_deg = now.position_deg, angle_deg
        self._started_s = self._clock.now_s()
        self._watchdog.begin()
        try:
            self._send_move(angle_deg)
            self._stop_if_stopped()
        except BaseException:
            self._watchdog.end()
            raise

    def wait(self) -> float:
        """Wait until the move has ended; returns where, in degrees, which must be the target."""
        if self._target_deg is None:
            return self.position_deg()
        try:
            return self._watch_move(self._target_deg)
        finally:
            self._watchdog.end()

    def _watch_move(self, target_deg: float) -> float:
        watch = _Watch(self._limits, self._from_deg, target_deg, self._started_s)
        while not watch.ended(now := self._looked()):
            self._refuse_lost(now)
            time_s = self._clock.now_s()
            if watch.not_begun(time_s):
                log.warning("%s: stands still: told again to go to %g deg", self.name, target_deg)
                self._send_move(target_deg)  # it stands where it was: nothing arrived
                self._stop_if_stopped()
            wrong = watch.wrong(now, time_s)
            if wrong:
                self._target_deg = None
                self.stop()
                raise DeviceError(f"{self.name}: {wrong}")
            self._clock.sleep(POLL_S)
        return self._arrived(now)

    def stop(self) -> None:
        """End all motion now; safe at any time, twice, and from another thread."""
        self._stopped = True
        self._watchdog.end()
        self._send_stop()

    def _looked(self) -> Status:
        """The status of a stage that neither has a fault nor was stopped; else `DeviceError`."""
        try:
            now = self._watchdog.hear(self.status)
        except DeviceError as error:
            if self._watchdog.fired:
                raise type(error)(f"{error}; {_UNHEARD}") from error
            raise
        if self._watchdog.fired:
            self._target_deg = None
            raise DeviceError(f"{self.name}: {_UNHEARD}: look at its cable, then home it")
        if self._stopped:
            self._target_deg = None
            raise Stopped(f"{self.name}: stopped at {now.position_deg:g} deg")
        self._refuse_fault(now)
        return now

    def _glanced(self) -> bool:
        """Whether the controller answers, asked while nobody else asks."""
        try:
            self.status(patient=False)
        except DeviceError as error:
            log.warning("%s", error)
            return False
        return True

    def _give_up(self) -> None:
        """Stop what moves unheard."""
        try:
            self.stop()
        except DeviceError as error:
            log.error("%s: %s; the stop failed too: %s", self.name, _UNHEARD, error)

    def _arrived(self, now: Status) -> float:
        self._refuse_lost(now)
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

    def _refuse_lost(self, now: Status) -> None:
        """A controller that was without power counts from nowhere."""
        if not now.homed and not now.moving:
            self._target_deg = None
            raise DeviceError(
                f"{self.name}: has lost its reference on the way: look at its controller's supply, "
                "then home it"
            )

    def _refuse_fault(self, now: Status) -> None:
        if now.fault:
            self._target_deg = None
            raise DeviceError(f"{self.name}: {now.fault}")


class _Homing:
    """Whether finding the reference goes as it should; `again`: it was known before."""

    def __init__(self, allowed_s: float, started_s: float, again: bool) -> None:
        self._allowed_s, self._started_s, self._known = allowed_s, started_s, again
        self._moved = self._again = False

    def ended(self, now: Status) -> bool:
        """The reference is known and the stage stands."""
        self._moved |= now.moving
        self._known &= now.homed and not now.moving
        return now.homed and not now.moving and not self._known

    def not_begun(self, time_s: float) -> bool:
        """Once: it should move by now, and does not."""
        late = not self._moved and not self._again and time_s - self._started_s > STARTS_WITHIN_S
        self._again |= late
        return late

    def wrong(self, time_s: float) -> str:
        """What is wrong, or nothing."""
        since_s = time_s - self._started_s
        if not self._moved and since_s > 2 * STARTS_WITHIN_S:
            return "did not begin to look for its reference: look at its motor's supply"
        if since_s > self._allowed_s:
            return (
                f"its reference was not found within {self._allowed_s:g} s: look at the reference "
                "switch, and whether something holds the stage"
            )
        return ""


class _Watch:
    """Whether a move goes as it should: it begins, gets on, and ends in time."""

    def __init__(self, limits: Limits, start: float, target: float, started_s: float) -> None:
        self._limits, self._target, self._started_s = limits, target, started_s
        way = Trapezoid(target - start, limits.speed_deg_per_s, limits.acceleration_deg_per_s2)
        self._allowed_s = 1.5 * way.duration_s + 2.0
        self._start = self._at = start
        self._at_s = started_s
        self._begun = self._again = False

    def ended(self, now: Status) -> bool:
        """No longer moving, and not because it has not begun yet."""
        self._begun |= now.moving or abs(now.position_deg - self._start) > self._step_deg
        return not now.moving and (self._begun or self._there(now))

    def not_begun(self, time_s: float) -> bool:
        """Once: it should move by now, and stands where it was."""
        late = not self._begun and time_s - self._started_s > STARTS_WITHIN_S
        once, self._again = late and not self._again, self._again or late
        return once

    def wrong(self, now: Status, time_s: float) -> str:
        """What is wrong with the move, or nothing."""
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

    @property
    def _step_deg(self) -> float:
        return self._limits.tolerance_deg / 10

    def _there(self, now: Status) -> bool:
        return abs(now.position_deg - self._target) <= self._limits.tolerance_deg
