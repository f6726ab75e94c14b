"""Clock as an interface, so that simulated scans and tests run without waiting."""

from __future__ import annotations

import time
from datetime import UTC, datetime
from typing import Protocol


class Clock(Protocol):
    """Source of time that is passed to everything that measures or waits."""

    def now_s(self) -> float:
        """Return monotonic time in seconds from an arbitrary start."""

    def utc(self) -> datetime:
        """Return the date and time in UTC."""

    def sleep(self, seconds: float) -> None:
        """Wait for `seconds`."""


class SystemClock:
    """Clocks of the computer."""

    def now_s(self) -> float:
        """Return the monotonic clock in seconds."""
        return time.monotonic()

    def utc(self) -> datetime:
        """Return the date and time in UTC."""
        return datetime.now(UTC)

    def sleep(self, seconds: float) -> None:
        """Wait for `seconds`; not at all if that is negative."""
        if seconds > 0:
            time.sleep(seconds)
