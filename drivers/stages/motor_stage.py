"""Common base of all motor stages: limits before a byte is sent, homing first, checked positions.

A driver provides the exchanges with its controller; the order of a move, the refusals and the stop
are here. `drivers.stages.motion` tells when a motion has begun and ended, and what is a stall.
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager

from drivers.stages.motion import LONG_S, STALLED_S, HomingMonitor, Limits, MoveMonitor, Status
from drivers.stages.watchdog import Watchdog
from instrument.clock import Clock
from instrument.closeable import Closeable
from instrument.devices import REPLY_S
from instrument.errors import ComputerPaused, DeviceError

log = logging.getLogger(__name__)

POLL_S = 0.005
_ROUNDING_DEG = 1e-9


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
        self._target_deg: float | None = None
        self._from_deg = 0.0
        self._started_s = 0.0
        self._stopped = self._speed_known = False
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
        """End all motion, ahead of everything that waits for the line."""

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
        now = self._status_before_motion()
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

    def _find_reference(self, again: bool) -> None:
        self._stopped, self._target_deg = False, None
        self.watchdog.begin()
        try:
            self._monitor_homing(again)
        finally:
            self.watchdog.end()

    def _monitor_homing(self, again: bool) -> None:
        self._send_home()
        self._repeat_stop()
        time_s = self._clock.now_s()
        monitor = HomingMonitor(self._limits.homing_s, time_s, again)
        while not monitor.ended(now := self._poll()):
            if monitor.should_resend(time_s):
                log.warning("%s: stands still: homing command sent again", self.name)
                self._send_home()  # it stands and has no reference: the command never arrived
            problem = monitor.problem(time_s)
            if problem:
                self.stop()
                raise DeviceError(f"{self.name}: {problem}, at {now.position_deg:g} deg")
            self._clock.sleep(POLL_S)
            time_s = self._clock.now_s()  # before the status: it is then judged by no later time

    def start_move(self, angle_deg: float) -> None:
        """Start a move to an angle in degrees.

        Before homing, past a limit and while there is a fault it is refused and nothing is sent.
        """
        self._refuse_beyond_limits(angle_deg)
        now = self._status_before_motion()
        self._refuse_fault(now)
        if not now.homed:
            raise DeviceError(f"{self.name}: not homed, so it must not move: home it first")
        self._stopped = False
        self._from_deg, self._target_deg = now.position_deg, angle_deg
        self._started_s = self._clock.now_s()
        self.watchdog.begin()
        try:
            with self._explained():
                self._send_move(angle_deg)
            self._repeat_stop()
        except BaseException:
            self.watchdog.end()
            raise

    def wait(self) -> float:
        """Wait for the end of the move; check the position and return it, in degrees."""
        if self._target_deg is None:
            return self.position_deg()
        try:
            return self._monitor_move(self._target_deg)
        finally:
            self.watchdog.end()

    def _monitor_move(self, target_deg: float) -> float:
        monitor = MoveMonitor(self._limits, self._from_deg, target_deg, self._started_s)
        time_s = self._clock.now_s()
        while not monitor.ended(now := self._poll(), time_s):
            self._refuse_lost_reference(now)
            if monitor.should_resend(time_s):
                log.warning("%s: stands still: move to %g deg sent again", self.name, target_deg)
                self._send_move(target_deg)  # it has not moved: the command never arrived
                self._repeat_stop()
            problem = monitor.problem(now, time_s)
            if problem:
                self._target_deg = None
                self.stop()
                raise DeviceError(f"{self.name}: {problem}")
            self._clock.sleep(POLL_S)
            time_s = self._clock.now_s()  # before the status: it is then judged by no later time
        arrived_deg = self._check_arrival(now)
        self._check_speed(monitor)
        return arrived_deg

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

    def stop(self) -> None:
        """End all motion now; safe at any time, repeatedly, and from any thread."""
        self._stopped = True
        self.watchdog.end()
        self._send_stop()

    def _poll(self) -> Status:
        """Return the status during a motion; raise if there is a fault or the stage was stopped."""
        with self._explained():
            now = self.watchdog.poll(self.status)
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
            kind = ComputerPaused if self.watchdog.paused_s else type(error)
            raise kind(f"{error}; {self._no_status}") from error

    def _raise_if_unwatched(self) -> None:
        """Raise, once the watchdog has stopped the stage, what was to blame: computer or line."""
        if not self.watchdog.fired:
            return
        self._target_deg = None
        if self.watchdog.paused_s:
            raise ComputerPaused(
                f"{self.name}: {self._no_status}: look at what else runs on this computer, and at "
                "its power saving"
            )
        raise DeviceError(f"{self.name}: {self._no_status}: look at its cable, then home it")

    @property
    def _no_status(self) -> str:
        silent_s, paused_s = self.watchdog.silent_s, self.watchdog.paused_s
        why = (
            f"the computer paused for {paused_s:.1f} s"
            if paused_s
            else f"no status for {silent_s:g} s"
        )
        return f"{why} while it moved, so it was told to stop"

    def _probe(self) -> bool:
        """Ask for the status without retries; True if the controller answers."""
        try:
            self.status(retry=False)
        except DeviceError as error:
            log.warning("%s", error)
            return False
        return True

    def _stop_unwatched(self) -> None:
        """Stop a motion of which no status was received; never raises."""
        try:
            self.stop()
        except DeviceError as error:
            log.error("%s: %s; the stop failed too: %s", self.name, self._no_status, error)

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

    def _repeat_stop(self) -> None:
        """Repeat a stop that came while a command was being sent, and raise `Stopped`."""
        self.watchdog.check_for_pause()
        if self._stopped:
            self._send_stop()
            self._raise_if_unwatched()
            raise Stopped(f"{self.name}: stopped as it was about to move")

    def _refuse_beyond_limits(self, angle_deg: float) -> None:
        low, high = self.limits_deg()
        if not low - _ROUNDING_DEG <= angle_deg <= high + _ROUNDING_DEG:
            raise DeviceError(
                f"{self.name}: {angle_deg:g} deg asked for; its limits are {low:g} to {high:g} deg "
                "(the device's own degrees): nothing has moved"
            )

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
