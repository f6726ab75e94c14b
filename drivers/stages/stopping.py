"""Stop that is verified: sent at once, read back, repeated, and reported if it cannot be confirmed.

A stop may be lost on the wire, and some controllers do not answer it. The end of a motion is
therefore known only from the status: a stage stands once two answers in a row say so, at one place.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

from drivers.lines.serial_line import REOPEN_EVERY_S, REOPEN_S, PortClosed, PortGone
from drivers.stages.motion import STALLED_S, Limits, Status
from instrument.clock import Clock
from instrument.errors import DeviceError

log = logging.getLogger(__name__)

STANDS_S = 0.05  # between two answers that report rest
CHECK_S = 0.1  # between two measurements of the speed
HARDER_AFTER_S = 0.5  # beyond the braking time: then the controller's harder stop, if it has one
REPORT_EVERY_S = 1.0
_BRAKING = 0.5  # share of the set deceleration at which a stage counts as braking
_ANSWERS = 6  # on a slow line: time allowed, in answers
_POLL_S = 0.005


class StopMonitor:
    """Judges by the statuses after a stop whether the stage stands, brakes, or moves on.

    A stage brakes if its speed falls by at least half of the set deceleration; this needs no
    knowledge of the speed, which is not known while homing. `rest_from_s`: a motion that was
    commanded just before the stop, and has not been seen, may begin until this time of the clock.
    """

    def __init__(self, limits: Limits, begun_s: float, rest_from_s: float) -> None:
        self._limits, self._rest_from_s = limits, rest_from_s
        self._moved = False
        self._rest: tuple[float, float] | None = None
        self._at: tuple[float, float] | None = None
        self._speed: float | None = None
        self._answered_s = begun_s

    def stands(self, now: Status | None, before_s: float, after_s: float) -> bool:
        """True once two answers report rest at one place; each came between the two times."""
        if now is None:
            return False
        if now.moving:
            self._rest, self._moved = None, True
            return False
        tolerance = self._limits.tolerance_deg
        if self._rest is None or abs(now.position_deg - self._rest[0]) > tolerance:
            self._rest = now.position_deg, after_s
            return False
        rested = before_s - self._rest[1] >= STANDS_S
        return rested and (self._moved or before_s >= self._rest_from_s)

    def should_resend(self, now: Status | None, time_s: float) -> bool:
        """True if the status is missing, or shows a motion that does not slow down.

        `time_s` is a time after the status, whose last part is the position.
        """
        if now is None:
            self._at = self._speed = None
            late = time_s - self._answered_s >= CHECK_S
            self._answered_s = time_s if late else self._answered_s
            return late
        self._answered_s = time_s
        if self._at is None:
            self._at = now.position_deg, time_s
            return False
        took_s = time_s - self._at[1]
        if took_s < CHECK_S:
            return False
        before, self._speed = self._speed, abs(now.position_deg - self._at[0]) / took_s
        self._at = now.position_deg, time_s
        if before is None:
            return False
        slower = _BRAKING * self._limits.acceleration_deg_per_s2 * took_s
        return self._speed > before - slower


class VerifiedStop:
    """Stop of one stage. `begin` sends it and returns; `finish` returns once the stage stands.

    `send` and `send_harder` send a stop once; `status` reads the status once. `wanted` is False as
    soon as the program has begun another motion.
    """

    def __init__(
        self,
        name: str,
        limits: Limits,
        clock: Clock,
        reply_s: float,
        *,
        send: Callable[[], None],
        send_harder: Callable[[], None],
        status: Callable[[], Status],
        wanted: Callable[[], bool],
    ) -> None:
        self._name, self._limits, self._clock = name, limits, clock
        self._soft, self._harder = send, send_harder
        self._status, self._wanted = status, wanted
        self._brakes_s = limits.speed_deg_per_s / limits.acceleration_deg_per_s2
        self._late_s = max(STALLED_S, _ANSWERS * reply_s)
        self._begun_s = clock.now_s()
        self._sent_s: float | None = None
        self._times = 0
        self._unsent: DeviceError | None = None
        self._unread: DeviceError | None = None
        self._reported_s: float | None = None
        self._late_since_s: float | None = None

    def begin(self) -> None:
        """Send the stop at once; a stop that cannot be sent is sent again by `finish`."""
        self._begun_s, self._sent_s = self._clock.now_s(), None
        self._times, self._unread = 0, None
        self._reported_s = self._late_since_s = None
        self._send(self._soft)

    def finish(self, rest_from_s: float) -> None:
        """Return once the stage was read to stand; raise `DeviceError` if that is not confirmed."""
        monitor = StopMonitor(self._limits, self._clock.now_s(), rest_from_s)
        while self._wanted():
            if self._unsent is not None:
                self._send(self._soft)
            before_s = self._clock.now_s()
            now = self._read()
            time_s = self._clock.now_s()
            if monitor.stands(now, before_s, time_s):
                return
            if self._too_late(before_s):
                raise self._unconfirmed(now)
            if monitor.should_resend(now, time_s) and self._unsent is None:
                self._repeat(now, time_s)
            gone = isinstance(self._unsent or self._unread, PortGone)
            self._clock.sleep(REOPEN_EVERY_S if gone else _POLL_S)

    def _send(self, send: Callable[[], None]) -> None:
        try:
            send()
        except PortClosed:
            raise
        except DeviceError as error:
            self._unsent = error
            return
        self._unsent, self._times = None, self._times + 1
        self._sent_s = self._sent_s or self._clock.now_s()

    def _read(self) -> Status | None:
        try:
            now = self._status()
        except PortClosed:
            raise
        except DeviceError as error:
            self._unread = error
            return None
        self._unread = None
        return now

    def _repeat(self, now: Status | None, time_s: float) -> None:
        sent_s = time_s if self._sent_s is None else self._sent_s
        harder = time_s - sent_s > self._brakes_s + HARDER_AFTER_S
        self._send(self._harder if harder else self._soft)
        self._report(now, time_s)  # after it: a terminal may hold up what is logged

    def _report(self, now: Status | None, time_s: float) -> None:
        """Log that a stop is sent again, the first time and then once a second."""
        if self._reported_s is not None and time_s - self._reported_s < REPORT_EVERY_S:
            return
        self._reported_s, since_s = time_s, time_s - self._begun_s
        seen = f"no status ({self._unread})" if now is None else f"at {now.position_deg:g} deg"
        log.warning("%s: no rest %.2f s after a stop, %s: sent again", self._name, since_s, seen)

    def _too_late(self, time_s: float) -> bool:
        """True if the time is up, and was up some answers ago: the computer may have paused."""
        if time_s <= self._until_s():
            return False
        self._late_since_s = self._late_since_s or time_s
        return time_s - self._late_since_s > 2 * STANDS_S

    def _until_s(self) -> float:
        """Return the time of the clock until which the stage must be read to stand.

        It may brake once the stop was sent; a port that has vanished is waited for.
        """
        until_s = self._begun_s
        if self._sent_s is not None:
            until_s = self._sent_s + self._brakes_s + self._late_s
        if isinstance(self._unsent or self._unread, PortGone):
            return max(until_s, self._begun_s + REOPEN_S)
        return max(until_s, self._begun_s + self._late_s)

    def _unconfirmed(self, now: Status | None) -> DeviceError:
        since_s = self._clock.now_s() - self._begun_s
        if now is not None:
            return DeviceError(
                f"{self._name}: may still move: not at rest at {now.position_deg:g} deg, "
                f"{since_s:.1f} s after it was told to stop ({self._times} times): cut its power, "
                "then look at its controller"
            )
        error = self._unsent or self._unread or DeviceError("no status")
        told = f"told to stop ({self._times} times), but" if self._times else "stop not sent, and"
        return type(error)(
            f"{self._name}: {told} not read to stand after {since_s:.1f} s: it may still move: "
            f"{error}"
        )
