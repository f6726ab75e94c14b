"""Meter of the pauses in which the computer runs no thread of this program."""

from __future__ import annotations

import threading

from instrument.clock import Clock

PAUSE_S = 0.2  # a thread that wakes later than this was not merely waiting for its turn
_TICK_S = 0.02


class PauseMeter:
    """One thread that does nothing but look at the clock, until the event of `begin` is set.

    A computer that is suspended, swaps or is overloaded, or a program that is stopped (Ctrl-Z),
    lets that thread wake late. The rest of the program then has no status of what moves, although
    line and device are in order.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._beat_s = clock.now_s()
        self._pauses: list[tuple[float, float]] = []

    def begin(self, over: threading.Event) -> None:
        """Forget earlier pauses, and measure until `over` is set."""
        self._beat_s, self._pauses = self._clock.now_s(), []
        threading.Thread(target=self._run, args=(over,), name="pauses", daemon=True).start()

    def paused_since_s(self, since_s: float) -> float:
        """Return the sum in s of the pauses that ended after a time of the clock, or have yet to.

        A pause may be over for the caller before the meter's own thread has woken.
        """
        pauses = [*self._pauses, self._late(self._clock.now_s())]
        return sum(late_s for end_s, late_s in pauses if end_s > since_s and late_s > PAUSE_S)

    def _run(self, over: threading.Event) -> None:
        while not over.wait(_TICK_S):
            end_s, late_s = self._late(self._clock.now_s())
            if late_s > PAUSE_S:
                self._pauses.append((end_s, late_s))
            self._beat_s = end_s

    def _late(self, now_s: float) -> tuple[float, float]:
        return now_s, now_s - self._beat_s - _TICK_S
