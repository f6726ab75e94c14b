"""Worker thread for calls that may block in a device driver, so that the caller never does.

The caller waits in short intervals: Ctrl-C still reaches it, and a hung driver is left behind.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, wait
from queue import SimpleQueue
from typing import TypeVar

from instrument.clock import Clock

Result = TypeVar("Result")
_CHECK_S = 0.1  # interval at which the caller checks the heartbeat


class Cancelled(Exception):
    """Nobody waits for this result any more."""


class Hung(Exception):
    """The job has not beaten its heart for too long; the caller goes on without a result."""


class Heartbeat:
    """Signals between a job and its caller: the job is alive, its result is still wanted."""

    def __init__(self, clock: Clock) -> None:
        self._clock, self._beat_s = clock, clock.now_s()
        self._cancelled = threading.Event()

    @property
    def silent_s(self) -> float:
        """Seconds since the last beat."""
        return self._clock.now_s() - self._beat_s

    def beat(self) -> None:
        """Report progress; raise `Cancelled` if the result is no longer wanted."""
        self._beat_s = self._clock.now_s()
        self.check()

    def check(self) -> None:
        """Raise `Cancelled` if the result is no longer wanted."""
        if self._cancelled.is_set():
            raise Cancelled

    def cancel(self) -> None:
        """Tell the job that its result is no longer wanted."""
        self._cancelled.set()


class WorkerThread:
    """Thread that does one job after another until it is told to end."""

    def __init__(self, name: str, clock: Clock) -> None:
        self._clock = clock
        self._jobs: SimpleQueue[Callable[[], object] | None] = SimpleQueue()
        threading.Thread(target=self._work, name=name, daemon=True).start()

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            job()
            del job  # its result belongs to the caller

    def call(self, action: Callable[[Heartbeat], Result], max_silent_s: float) -> Result:
        """Run `action` and return its result, or raise its error.

        Raises `Hung` if the job has no heartbeat for `max_silent_s`.
        """
        heartbeat = Heartbeat(self._clock)
        future = self.post(lambda: action(heartbeat))
        try:
            while not wait((future,), _CHECK_S).done:
                if heartbeat.silent_s > max_silent_s:
                    raise Hung
        except BaseException:
            heartbeat.cancel()
            raise
        return future.result()

    def post(self, action: Callable[[], Result]) -> Future[Result]:
        """Queue `action` and return at once."""
        future: Future[Result] = Future()
        self._jobs.put(lambda: _run(action, future))
        return future

    def end(self) -> None:
        """End the thread after the queued jobs; return at once."""
        self._jobs.put(None)


def _run(action: Callable[[], Result], future: Future[Result]) -> None:
    try:
        future.set_result(action())
    except BaseException as error:  # noqa: BLE001 - handed over: the caller raises it
        future.set_exception(error)
