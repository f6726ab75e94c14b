"""Whose turn it is on a line: one exchange at a time, and a stop before all that wait."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager


class PriorityLock:
    """A lock in two classes: whoever asks urgently is let in before those who only ask.

    The thread that has the turn may take it again.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._owner: int | None = None
        self._depth = 0
        self._urgent = 0

    @contextmanager
    def turn(self, urgent: bool = False) -> Iterator[None]:
        """Have the line for oneself."""
        self._take(urgent)
        try:
            yield
        finally:
            self._give()

    def _take(self, urgent: bool) -> None:
        me = threading.get_ident()
        with self._changed:
            if self._owner != me:
                self._urgent += urgent
                try:
                    self._changed.wait_for(lambda: self._free_for(urgent))
                finally:
                    self._urgent -= urgent
                self._owner = me
            self._depth += 1

    def _free_for(self, urgent: bool) -> bool:
        return self._owner is None and (urgent or not self._urgent)

    def _give(self) -> None:
        with self._changed:
            self._depth -= 1
            if not self._depth:
                self._owner = None
            self._changed.notify_all()
