"""Actions of a rig, one after the other in a thread of their own, and the status of each.

A run engine asks for a move or an exposure and goes on meanwhile. The rig does one thing at a time:
the path of a move is only known to be clear while no other axis moves.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

from instrument.closeable import Closeable
from instrument.errors import DeviceError

Answer = TypeVar("Answer")


class ActionStatus:
    """Status of one action, as bluesky's protocol `Status` asks for it."""

    def __init__(self, future: Future[object]) -> None:
        self._future = future

    def add_callback(self, callback: Callable[[ActionStatus], None]) -> None:
        """Call `callback` with this status at the end of the action, at once if it has ended."""
        self._future.add_done_callback(lambda _: callback(self))

    def exception(self, timeout: float | None = 0.0) -> BaseException | None:
        """Return the error of the action, None if it went well; wait `timeout` s for its end.

        Raises `TimeoutError` if it has not ended by then.
        """
        return self._future.exception(timeout)

    def wait(self, timeout: float | None = None) -> None:
        """Wait `timeout` s for the action to go well; raise its error, or `TimeoutError`."""
        self._future.result(timeout)

    @property
    def done(self) -> bool:
        """True once the action has ended."""
        return self._future.done()

    @property
    def success(self) -> bool:
        """True once the action has ended without an error."""
        return self.done and self._future.exception() is None


class ActionThread(Closeable):
    """Thread that carries out the actions of one rig in the order in which they are asked for."""

    def __init__(self) -> None:
        self._executor = ThreadPoolExecutor(max_workers=1, thread_name_prefix="rig")
        self.closed = False

    def begin(self, action: Callable[[], object]) -> ActionStatus:
        """Have an action carried out after those before it; return its status at once."""
        if self.closed:
            raise DeviceError("the rig is closed: open it again")
        return ActionStatus(self._executor.submit(action))

    def ask(self, question: Callable[[], Answer]) -> Answer:
        """Return what a question answers that is asked after the actions before it."""
        return self._executor.submit(question).result()

    def end(self) -> None:
        """Refuse further actions; those that were asked for are still carried out."""
        self.closed = True
        self._executor.shutdown(wait=False)

    def close(self) -> None:
        """End the thread after the actions that were asked for; may be called twice."""
        self.closed = True
        self._executor.shutdown(wait=True)
