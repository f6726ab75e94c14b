"""A thread of its own for calls that may block in a driver, so that the caller never does.

The caller waits in short turns: Ctrl-C still reaches it, and a driver that hangs is left behind.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, wait
from queue import SimpleQueue
from typing import TypeVar

from instrument.clock import Clock

Result = TypeVar("Result")
_GLANCE_S = 0.1  # how often the caller looks whether the thread still shows life


class Cancelled(Exception):
    """Nobody waits for this answer any more."""


class Hung(Exception):
    """The thread has shown no life for too long; the caller goes on without an answer."""


class Heartbeat:
    """What a job and its caller tell each other: still alive, still wanted."""

    def __init__(self, clock: Clock) -> None:
        self._clock, self._beat_s = clock, clock.now_s()
        self._cancelled = threading.Event()

    @property
    def quiet_s(self) -> float:
        """How long ago the job last showed life."""
        return self._clock.now_s() - self._beat_s

    def beat(self) -> None:
        """Show life; raise `Cancelled` when the answer is no longer wanted."""
        self._beat_s = self._clock.now_s()
        self.check()

    def check(self) -> None:
        """Raise `Cancelled` when the answer is no longer wanted."""
        if self._cancelled.is_set():
            raise Cancelled

    def cancel(self) -> None:
        """The answer is no longer wanted."""
        self._cancelled.set()


class Reader:
    """The thread: does one job after the other until it is told to end."""

    def __init__(self, name: str, clock: Clock) -> None:
        self._clock = clock
        self._jobs: SimpleQueue[Callable[[], object] | None] = SimpleQueue()
        threading.Thread(target=self._work, name=name, daemon=True).start()

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            job()
            del job  # its result is the caller's

    def call(self, action: Callable[[Heartbeat], Result], quiet_s: float) -> Result:
        """Have `action` done and return its result, or raise what it raised.

        `Hung` is raised when the job shows no life for `quiet_s`.
        """
        life = Heartbeat(self._clock)
        future = self.post(lambda: action(life))
        try:
            while not wait((future,), _GLANCE_S).done:
                if life.quiet_s > quiet_s:
                    raise Hung
        except BaseException:
            life.cancel()
            raise
        return future.result()

    def post(self, action: Callable[[], Result]) -> Future[Result]:
        """Have `action` done when its turn comes."""
        future: Future[Result] = Future()
        self._jobs.put(lambda: _run(action, future))
        return future

    def end(self) -> None:
        """End the thread once it has done what is waiting; returns at once."""
        self._jobs.put(None)


def _run(action: Callable[[], Result], future: Future[Result]) -> None:
    try:
        future.set_result(action())
    except BaseException as error:  # noqa: BLE001 - handed over: the caller raises it
        future.set_exception(error)
