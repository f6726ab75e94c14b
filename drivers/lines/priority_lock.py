"""Re-entrant lock with two priorities: a stop overtakes queued exchanges."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager


class PriorityLock:
    """Lock of one line: urgent callers enter before all others that wait.

    The thread that holds the lock may take it again.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._owner: int | None = None
        self._depth = 0
        self._urgent_waiting = 0

    @contextmanager
    def hold(self, urgent: bool = False) -> Iterator[None]:
        """Hold the lock during a `with` block."""
        self._acquire(urgent)
        try:
            yield
        finally:
            self._release()

    def _acquire(self, urgent: bool) -> None:
        me = threading.get_ident()
        with self._changed:
            if self._owner != me:
                self._urgent_waiting += urgent
                try:
                    self._changed.wait_for(lambda: self._free_for(urgent))
                finally:
                    self._urgent_waiting -= urgent
                self._owner = me
            self._depth += 1

    def _free_for(self, urgent: bool) -> bool:
        return self._owner is None and (urgent or not self._urgent_waiting)

    def _release(self) -> None:
        with self._changed:
            self._depth -= 1
            if not self._depth:
                self._owner = None
            self._changed.notify_all()
