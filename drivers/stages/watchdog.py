"""Watchdog that stops a stage which moves without a status report for too long."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeVar

from drivers.stages.pause_meter import PauseMeter
from instrument.clock import Clock
from instrument.devices import REPLY_S

SILENT_S = 0.5  # a status older than this is out of date
# Between the beginning of a move and the status after one lost answer: three answers to send it,
# two to a probe of which one is lost, quiet, one to get in step, two of the status. Answers that
# come take half of the time allowed or less.
ANSWERS = 8
_TICK_S = 0.02
_PROBE_AFTER_S = 0.1
_AFTER_PROBE_S = 0.05  # beyond a last answer: a probe must have failed before the time is up

T = TypeVar("T")


def silence_allowed_s(reply_s: float) -> float:
    """Return the age in s at which a status is out of date, on a line that answers in `reply_s`."""
    return SILENT_S + ANSWERS * max(reply_s - REPLY_S, 0.0)


class Watchdog:
    """One thread that runs while something moves.

    The program reads the status through `poll`. While nobody polls, the thread calls `probe`,
    which asks once, without retries, and returns True for an answer. After `silent_s` without an
    answer to either, the thread calls `stop`. Neither `probe` nor `stop` may raise. `paused_s` is
    then the time for which the computer was paused, 0 if the line would have been too late anyway.
    """

    def __init__(
        self,
        name: str,
        probe: Callable[[], bool],
        stop: Callable[[], None],
        clock: Clock,
        reply_s: float = REPLY_S,
    ) -> None:
        self.silent_s = silence_allowed_s(reply_s)
        self._probe_before_s = self.silent_s - reply_s - _AFTER_PROBE_S
        self._name, self._probe, self._stop, self._clock = name, probe, stop, clock
        self._asking, self._firing = threading.Lock(), threading.Lock()
        self._over = threading.Event()
        self._over.set()
        self._answered_s = 0.0
        self._meter = PauseMeter(clock)
        self._thread: threading.Thread | None = None
        self.fired, self.paused_s = False, 0.0

    def begin(self) -> None:
        """Start to watch, just before a motion."""
        self.end()
        self.fired, self.paused_s, self._answered_s = False, 0.0, self._clock.now_s()
        self._over = threading.Event()
        self._meter.begin(self._over)
        self._thread = threading.Thread(
            target=self._watch, args=(self._over,), name=f"watchdog {self._name}", daemon=True
        )
        self._thread.start()

    def finish_stop(self) -> None:
        """Wait until a stop that has begun is sent: it must not end the next motion."""
        if self.fired and self._thread is not None:
            self._thread.join()

    def end(self) -> None:
        """Stop watching: the motion has ended, or was told to."""
        self._over.set()

    def poll(self, read_status: Callable[[], T]) -> T:
        """Return the status; an answer restarts the time allowed, unless a pause has used it up."""
        with self._asking:
            status = read_status()
            self.check_for_pause()
            self._answered_s = self._clock.now_s()
            return status

    def check_for_pause(self) -> None:
        """Stop the motion, once, if a pause of the computer has used up the time allowed.

        The thread may wake later than the caller, who has an answer by then.
        """
        if self._meter.paused_since_s(self._answered_s):
            self.check()

    def check(self) -> None:
        """Stop the motion, once, if the time allowed is up."""
        with self._firing:
            silent_s = self._silent_s
            if self._over.is_set() or silent_s <= self.silent_s:
                return
            paused_s = self._meter.paused_since_s(self._answered_s)
            self.paused_s = paused_s if silent_s - paused_s <= self.silent_s else 0.0
            self.fired = True
            self._over.set()
        self._stop()

    @property
    def _silent_s(self) -> float:
        return self._clock.now_s() - self._answered_s

    def _watch(self, over: threading.Event) -> None:
        while not over.wait(_TICK_S):
            self.check()
            if _PROBE_AFTER_S < self._silent_s < self._probe_before_s:
                self._probe_unless_polled()

    def _probe_unless_polled(self) -> None:
        if not self._asking.acquire(blocking=False):
            return
        try:
            if self._probe():
                self._answered_s = self._clock.now_s()
        finally:
            self._asking.release()
