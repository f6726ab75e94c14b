"""Time, injected: a scan never reads the wall clock by itself, so tests never wait for it."""

from __future__ import annotations

from datetime import datetime
from typing import Protocol


class Clock(Protocol):
    """What the program knows of time."""

    def now_s(self) -> float:
        """Seconds that only ever grow, from an arbitrary start."""
        ...

    def utc(self) -> datetime:
        """The date and time, UTC."""
        ...

    def sleep(self, seconds: float) -> None:
        """Let `seconds` pass."""
        ...
