"""Pause of a scan: asked for from any thread, begun between two geometries."""

from __future__ import annotations

import threading
from collections.abc import Callable

_LOOK_S = 1.0  # a wait without an end could not be left on every system


class PauseSwitch:
    """Switch that an operator turns while a scan runs; the scan looks at it between geometries.

    `say` tells the operator in one line that the scan has paused, or goes on.
    """

    def __init__(self, say: Callable[[str], None] = lambda _: None) -> None:
        self.say = say
        self._changed = threading.Condition()
        self._on, self.turned_by = False, ""

    @property
    def is_on(self) -> bool:
        """True if the scan shall pause, or stays paused."""
        return self._on

    def turn(self, *, on: bool, by: str) -> None:
        """Have the scan pause before its next geometry, or go on; from any thread.

        by: place where the operator said so, for the record: "at the terminal".
        """
        with self._changed:
            self._on, self.turned_by = on, by
            self._changed.notify_all()

    def wait(self) -> None:
        """Return once the scan shall go on; a signal ends the wait."""
        with self._changed:
            while self._on:
                self._changed.wait(_LOOK_S)


class Paused(Exception):
    """Leaves the steps of a scan before the next one is begun."""
