"""Watchdog that stops a stage which moves unseen, astray, or without the program looking at it.

Its promise, as long as the computer runs this program at all: a stage moves no longer than
`silence_allowed_s` (0.5 s, more on a slow line) and its braking time

- without a status: the cable, the controller or its port is out of order;
- after a status that the motion's monitor objects to: it stalls, runs beyond the way from its start
  to its target, or takes too long;
- while the program waits for it and its loop does not come back to ask, although the line answers.

Between the beginning of a move and the wait for its end the program may be busy elsewhere, for as
long as it takes: it reduces frames and commits them, and a disk may need many seconds. No time is
set for that, because the move is then judged all the same: the thread here reads the status and
hands it to the monitor, so that the stage ends at its target, on its way there or where it was
stopped. A program that is frozen as a whole, or killed, cannot stop anything: then the controller
ends the move at its target.
"""

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

    The program reads the status through `poll`. While nobody polls, the thread calls `probe`, which
    asks once, without retries: it returns what is wrong with the motion, an empty text if nothing
    is, and None without an answer. The thread calls `stop` if there is something wrong, after
    `silent_s` without an answer, and after `silent_s` without a poll once the program has begun to
    poll. Neither `probe` nor `stop` may raise.

    Once it has `fired`, `why` says the reason. `no_fault`: no device is to blame, but the computer
    was paused, or the program was held up.
    """

    def __init__(
        self,
        name: str,
        probe: Callable[[], str | None],
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
        self._polled_s: float | None = None
        self._problem = ""
        self._meter = PauseMeter(clock)
        self._thread: threading.Thread | None = None
        self.fired, self.no_fault, self.why = False, False, ""

    def begin(self) -> None:
        """Start to watch, just before a motion."""
        self.end()
        self.fired, self.no_fault, self.why = False, False, ""
        self._answered_s, self._polled_s, self._problem = self._clock.now_s(), None, ""
        self._over = threading.Event()
        self._meter.begin(self._over)
        self._thread = threading.Thread(
            target=self._watch, args=(self._over,), name=f"watchdog {self._name}", daemon=True
        )
        self._thread.start()

    def finish_stop(self) -> None:
        """Wait until a stop that has begun is over: it must not end the next motion."""
        if self.fired and self._thread is not None:
            self._thread.join()

    def end(self) -> None:
        """Stop watching: the motion has ended, or was told to."""
        self._over.set()

    def poll(self, read_status: Callable[[], T]) -> T:
        """Return the status; an answer restarts the time allowed, unless a pause has used it up."""
        with self._asking:
            self._polled_s = self._clock.now_s()
            status = read_status()
            self.check_for_pause()
            self._answered_s = self._polled_s = self._clock.now_s()
            return status

    def check_for_pause(self) -> None:
        """Stop the motion, once, if a pause of the computer has used up the time allowed.

        The thread may wake later than the caller, who has an answer by then.
        """
        if self._meter.paused_since_s(self._seen_s):
            self.check()

    def check(self) -> None:
        """Stop the motion, once, if something is wrong with it or the time allowed is up."""
        with self._firing:
            if self._over.is_set():
                return
            self.why = self._problem or self._too_old()
            if not self.why:
                return
            self.fired = True
            self._over.set()
        self._stop()

    def _too_old(self) -> str:
        """Return what has used up the time allowed, or an empty text."""
        since_s = self._seen_s
        silent_s = self._clock.now_s() - since_s
        if silent_s <= self.silent_s:
            return ""
        paused_s = self._meter.paused_since_s(since_s)
        if silent_s - paused_s <= self.silent_s:
            self.no_fault, what = True, f"the computer paused for {paused_s:.1f} s"
        elif since_s < self._answered_s:
            self.no_fault, what = True, f"the program did not look at it for {silent_s:.1f} s"
        else:
            what = f"no status for {self.silent_s:g} s"
        return f"{what} while it moved, so it was told to stop"

    @property
    def _seen_s(self) -> float:
        """Time of the last answer, or of the program's last poll if that is older."""
        polled_s = self._answered_s if self._polled_s is None else self._polled_s
        return min(self._answered_s, polled_s)

    def _watch(self, over: threading.Event) -> None:
        while not over.wait(_TICK_S):
            self.check()
            silent_s = self._clock.now_s() - self._answered_s
            if _PROBE_AFTER_S < silent_s < self._probe_before_s:
                self._probe_unless_polled()

    def _probe_unless_polled(self) -> None:
        if not self._asking.acquire(blocking=False):
            return
        try:
            found = self._probe()
            if found is not None:
                self._answered_s, self._problem = self._clock.now_s(), found
        finally:
            self._asking.release()
