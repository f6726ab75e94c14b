"""Common base of all motor stages: limits before a byte is sent, homing first, checked positions.

A driver provides the exchanges with its controller; the order of a move, the refusals and the stop
are here. `drivers.stages.motion` tells when a motion has begun and ended, and what is a stall.
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from drivers.stages.motion import (
    LONG_S,
    STALLED_S,
    HomingMonitor,
    Limits,
    Monitor,
    MoveMonitor,
    Status,
    require_within,
)
from drivers.stages.stopping import VerifiedStop
from drivers.stages.watchdog import Watchdog
from instrument.clock import Clock
from instrument.closeable import Closeable
from instrument.devices import REPLY_S
from instrument.errors import ComputerPaused, DeviceError

log = logging.getLogger(__name__)

POLL_S = 0.005


class Stopped(DeviceError):
    """The motion was stopped before it reached its end."""


class MotorStage(ABC):
    """A stage behind a controller. Angles are the device's own degrees.

    `line` is closed with the stage; None for a line that others share.
    """

    KEEPS_REFERENCE = False
    """True for controllers that refuse to search for a reference that they have."""

    def __init__(
        self,
        name: str,
        limits: Limits,
        clock: Clock,
        line: Closeable | None = None,
        reply_s: float = REPLY_S,
    ) -> None:
        self.name, self._limits, self._clock, self._line = name, limits, clock, line
        self._rig_limits = limits
        self._target_deg: float | None = None
        self._motion: Monitor | None = None
        self._stopped = self._speed_known = False
        self._stops_asked = self._stops_seen = 0
        self._stop = VerifiedStop(
            name, limits, clock, reply_s, send=self._send_stop, send_harder=self._send_harder_stop,
            status=self._status_after_stop, wanted=lambda: self._stopped,
        )  # fmt: skip
        self.watchdog = Watchdog(name, self._probe, self._stop_unwatched, clock, reply_s)

    # To be provided by a driver.

    @abstractmethod
    def identity(self) -> str:
        """Return maker, model and serial number of the device that answers."""

    @abstractmethod
    def status(self, retry: bool = True) -> Status:
        """Read position and state; without `retry` no question is repeated."""

    @abstractmethod
    def _own_limits_deg(self) -> tuple[float, float]:
        """Return the limits set in the controller; infinite if it has none."""

    @abstractmethod
    def _send_home(self) -> None:
        """Start the controller's search for its reference."""

    @abstractmethod
    def _apply_speed(self) -> None:
        """Set the rig file's speed in a controller that stores one; called after homing."""

    @abstractmethod
    def _send_move(self, angle_deg: float) -> None:
        """Send one move command; if its answer is lost, the stage's state decides."""

    @abstractmethod
    def _send_stop(self) -> None:
        """Tell the controller once to end all motion, ahead of everything that waits for the line.

        Raise `DeviceError` if it cannot be told, or if it does not acknowledge what it should.
        """

    def _send_harder_stop(self) -> None:
        """End a motion that earlier stops have not ended, by a controller's harder stop."""
        self._send_stop()

    def _status_after_stop(self) -> Status:
        """Read the status once, quickly enough that a stop can be repeated in time."""
        return self.status(retry=False)

    def _own_settings(self) -> dict[str, str]:
        """Return the controller's settings, apart from its limits."""
        return {}

    # For the program.

    def homed(self) -> bool:
        """True if the controller knows its reference, read once the stage is at rest."""
        self.watchdog.finish_stop()
        return self._wait_for_rest(self.status()).homed

    def _wait_for_rest(self, now: Status) -> Status:
        """Return the status once a stage that was stopped is at rest."""
        ramp_s = self._limits.speed_deg_per_s / self._limits.acceleration_deg_per_s2
        until_s = self._clock.now_s() + ramp_s + STALLED_S
        while now.moving:
            late = self._clock.now_s() > until_s  # read before a status that may come much later
            now = self.status()
            if now.moving and late:
                raise DeviceError(
                    f"{self.name}: still moves {ramp_s + STALLED_S:.1f} s after it was stopped: "
                    "cut its power, then look at its controller"
                )
            self._clock.sleep(POLL_S)
        return now

    def _status_before_motion(self) -> Status:
        """Return the status at rest; refuse a stage that is still executing a move."""
        self.watchdog.finish_stop()
        self._stops_seen = self._stops_asked
        now = self.status()
        if now.moving and not self._stopped:
            raise DeviceError(
                f"{self.name}: is moving already, at {now.position_deg:g} deg: wait for its "
                "end, or stop it first"
            )
        return self._wait_for_rest(now)

    def settings(self) -> dict[str, str]:
        """Return the limits in force and the controller's settings."""
        low, high = self.limits_deg()
        return {"limits_deg": f"{low:g} to {high:g}", **self._own_settings()}

    def limits_deg(self) -> tuple[float, float]:
        """Return the narrower of the rig file's limits and the controller's, in degrees."""
        low, high = self._own_limits_deg()
        return max(low, self._limits.min_deg), min(high, self._limits.max_deg)

    def position_deg(self) -> float:
        """Return the position in degrees; refused before homing and while there is a fault.

        Before homing the controller's count means nothing; a motor without current may be turned.
        """
        now = self.status()
        self._refuse_fault(now)
        if not now.homed and not now.moving:
            raise DeviceError(
                f"{self.name}: not homed, so its position is not known: home it first"
            )
        return now.position_deg

    def home(self) -> None:
        """Find the reference and stop at home; a controller that keeps its reference only moves."""
        now, self._limits = self._status_before_motion(), self._rig_limits
        self._refuse_fault(now)
        if now.homed and self.KEEPS_REFERENCE:
            self._set_speed()
            self.start_move(self._limits.home_deg)
            self.wait()
            return
        self._find_reference(again=now.homed)
        self._set_speed()

    def _set_speed(self) -> None:
        self._apply_speed()
        self._speed_known = False  # what is read back need not be what is done

    def set_speed(self, speed_deg_per_s: float) -> None:
        """Let later moves turn at this speed, at most the rig file's; refused during a motion."""
        slower = self._rig_limits.at_speed(self.name, speed_deg_per_s)
        self._refuse_fault(self._status_before_motion())
        self._limits = slower
        self._set_speed()

    def _find_reference(self, again: bool) -> None:
        self._target_deg = None
        self._begin(HomingMonitor(self._limits.homing_s, self._clock.now_s(), again))
        self._send(self._send_home)
        self._monitor("homing command", self._send_home)
        self.watchdog.end()

    def start_move(self, angle_deg: float) -> None:
        """Start a move to an angle in degrees.

        Before homing, past a limit and while there is a fault it is refused and nothing is sent.
        """
        require_within(self.name, angle_deg, self.limits_deg())
        now = self._status_before_motion()
        self._refuse_fault(now)
        if not now.homed:
            raise DeviceError(f"{self.name}: not homed, so it must not move: home it first")
        self._target_deg, start_deg = angle_deg, now.position_deg
        self._begin(MoveMonitor(self._limits, start_deg, angle_deg, self._clock.now_s()))
        with self._explained():
            self._send(lambda: self._send_move(angle_deg))

    def wait(self) -> float:
        """Wait for the end of the move; check the position and return it, in degrees."""
        motion, target_deg = self._motion, self._target_deg
        if target_deg is None or not isinstance(motion, MoveMonitor):
            return self.position_deg()
        what = f"move to {target_deg:g} deg"
        now = self._monitor(what, lambda: self._send_move(target_deg))
        arrived_deg = self._check_arrival(now)
        self._check_speed(motion)
        self.watchdog.end()
        return arrived_deg

    def _monitor(self, what: str, resend: Callable[[], None]) -> Status:
        """Return the status at the end of a motion; if anything else ends it, it is watched on."""
        while True:
            now, motion = self._poll(), self._motion
            if motion is None or motion.ended:
                return now
            if motion.NEEDS_REFERENCE:
                self._refuse_lost_reference(now)
            if motion.should_resend():
                log.warning("%s: stands still: %s sent again", self.name, what)
                self._send(resend)  # the command never arrived
            if motion.problem:
                self._target_deg = None
                self._stop_or_report()
                raise DeviceError(f"{self.name}: {motion.problem}")
            self._clock.sleep(POLL_S)

    def _check_speed(self, monitor: MoveMonitor) -> None:
        """Compare the first long move since the speed was set with its duration."""
        if self._speed_known or monitor.duration_s < LONG_S:
            return
        problem = monitor.speed_problem(self._clock.now_s())
        if problem:
            raise DeviceError(f"{self.name}: {problem}")
        self._speed_known = True

    def close(self) -> None:
        """Release the line; safe to call twice."""
        self.watchdog.end()
        if self._line is not None:
            self._line.close()

    def begin_stop(self) -> None:
        """Send a stop now, ahead of everything; at any time, repeatedly, and from any thread.

        It does not wait: whether the stage stands, `finish_stop` says.
        """
        self._stopped, self._stops_asked = True, self._stops_asked + 1
        self.watchdog.end()
        self._stop.begin()

    def finish_stop(self) -> None:
        """Return once the stage was read to stand; a stop that has no effect is sent again.

        Raise `DeviceError` if it still moves, or cannot be read, after the time to brake.
        """
        motion = self._motion
        self._stop.finish(motion.may_begin_until_s if motion else 0.0)

    def stop(self) -> None:
        """End all motion, and return once the stage was read to stand."""
        self.begin_stop()
        self.finish_stop()

    def _observe(self, retry: bool = True) -> Status:
        """Read the status, and have the motion judged by it."""
        time_s = self._clock.now_s()
        now = self.status(retry)
        if self._motion is not None:
            self._motion.see(now, time_s)
        return now

    def _poll(self) -> Status:
        """Return the status during a motion; raise if there is a fault or the stage was stopped."""
        with self._explained():
            now = self.watchdog.poll(self._observe)
        self._raise_if_unwatched()
        if self._stopped:
            self._target_deg = None
            raise Stopped(f"{self.name}: stopped at {now.position_deg:g} deg")
        self._refuse_fault(now)
        return now

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """Add to an error of the line what the watchdog has found, if it has stopped the stage.

        Answers that were lost in a pause of the computer are no fault of the line; whether it is
        in order shows before the stage is moved on.
        """
        try:
            yield
        except (Stopped, ComputerPaused):
            raise
        except DeviceError as error:
            self.watchdog.check()  # its own thread may wake later than this one
            if not self.watchdog.fired:
                raise
            kind = ComputerPaused if self.watchdog.no_fault else type(error)
            raise kind(f"{error}; {self.watchdog.why}") from error

    def _raise_if_unwatched(self) -> None:
        """Raise what was to blame once the watchdog has stopped the stage."""
        if not self.watchdog.fired:
            return
        self._target_deg, why = None, self.watchdog.why
        if self.watchdog.no_fault:
            raise ComputerPaused(
                f"{self.name}: {why}: look at what else runs on this computer, and at its power "
                "saving"
            )
        look = "" if ": look" in why else ": look at its cable, then home it"
        raise DeviceError(f"{self.name}: {why}{look}")

    def _probe(self) -> str | None:
        """Ask for the status without retries; return what is wrong with the motion, "" if nothing.

        None if the controller does not answer.
        """
        try:
            self._observe(retry=False)
        except DeviceError as error:
            log.warning("%s", error)
            return None
        return self._motion.problem if self._motion else ""

    def _stop_unwatched(self) -> None:
        """Stop a motion that the watchdog objects to; never raises."""
        self._stop_or_report(f"{self.watchdog.why}; ")

    def _stop_or_report(self, why: str = "") -> None:
        """Stop where another error is on its way; that the stop failed is reported by the log."""
        try:
            self.stop()
        except DeviceError as error:
            log.error("%s: %s%s", self.name, why, error)

    def _check_arrival(self, now: Status) -> float:
        self._refuse_lost_reference(now)
        target, self._target_deg = self._target_deg, None
        if target is not None and abs(now.position_deg - target) > self._limits.tolerance_deg:
            raise DeviceError(
                f"{self.name}: stands at {now.position_deg:g} deg instead of {target:g} deg "
                f"(allowed: {self._limits.tolerance_deg:g} deg off): look for what holds the "
                "stage, then home it"
            )
        return now.position_deg

    def _begin(self, motion: Monitor) -> None:
        """Begin to watch a motion, unless a stop has come since the status before it was read."""
        self._stopped, self._motion = False, motion
        if self._stops_asked != self._stops_seen:
            self._stopped = True
            raise Stopped(f"{self.name}: stopped before it was told to move")
        self.watchdog.begin()

    def _send(self, command: Callable[[], None]) -> None:
        """Send a motion command; repeat a stop that came meanwhile, and raise `Stopped`."""
        command()
        if self._motion is not None:
            self._motion.sent(self._clock.now_s())
        self.watchdog.check_for_pause()
        if self._stopped:
            self._stop_or_report()  # the first stop may have come before the command
            self._raise_if_unwatched()
            raise Stopped(f"{self.name}: stopped as it was about to move")

    def _refuse_lost_reference(self, now: Status) -> None:
        """Raise if the reference was lost: a controller that was without power has no position."""
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
