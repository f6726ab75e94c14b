"""Simulated time: a sleep takes no time at all, yet the clock has moved on."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta


class SimulatedClock:
    """A clock that only moves when somebody sleeps."""

    def __init__(self) -> None:
        self._start = datetime.now(UTC)
        self._elapsed_s = 0.0

    def now_s(self) -> float:
        """Simulated seconds since the clock was made."""
        return self._elapsed_s

    def utc(self) -> datetime:
        """The start's date plus the simulated seconds."""
        return self._start + timedelta(seconds=self._elapsed_s)

    def sleep(self, seconds: float) -> None:
        """Move on by `seconds` at once."""
        self._elapsed_s += max(0.0, seconds)
