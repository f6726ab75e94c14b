"""Ends a motion of which nothing was heard for too long, whatever else the program is busy with."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TypeVar

SILENT_S = 0.5  # a status older than this is no status
_TICK_S = 0.02
_GLANCE_AFTER_S, _GLANCE_BEFORE_S = 0.1, 0.3  # it must have failed before the time is up

T = TypeVar("T")


class Watchdog:
    """One thread for as long as something moves.

    Whoever asks for the status does so with `hear`; while nobody does, `glance` asks, once and
    without patience, and says whether there was an answer. Where neither has had one for
    `SILENT_S`, `stop` is called. Neither may raise.
    """

    def __init__(self, name: str, glance: Callable[[], bool], stop: Callable[[], None]) -> None:
        self._name, self._glance, self._stop = name, glance, stop
        self._asking = threading.Lock()
        self._over = threading.Event()
        self._over.set()
        self._heard_s = 0.0
        self.fired = False

    def begin(self) -> None:
        """Something is about to move."""
        self.end()
        self.fired, self._heard_s = False, time.monotonic()
        self._over = threading.Event()
        threading.Thread(
            target=self._watch, args=(self._over,), name=f"watchdog {self._name}", daemon=True
        ).start()

    def end(self) -> None:
        """It stands, or was told to stop."""
        self._over.set()

    def hear(self, ask: Callable[[], T]) -> T:
        """Ask for the status; an answer is a sign of life."""
        with self._asking:
            answer = ask()
            self._heard_s = time.monotonic()
            return answer

    def _watch(self, over: threading.Event) -> None:
        while not over.wait(_TICK_S):
            silent_s = time.monotonic() - self._heard_s
            if silent_s > SILENT_S:
                self.fired = True
                over.set()
                self._stop()
                return
            if _GLANCE_AFTER_S < silent_s < _GLANCE_BEFORE_S:
                self._look()

    def _look(self) -> None:
        """Where somebody else is asking, their answer will do."""
        if not self._asking.acquire(blocking=False):
            return
        try:
            if self._glance():
                self._heard_s = time.monotonic()
        finally:
            self._asking.release()
