"""Simulated clock: a sleep returns at once and advances the time."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta


class SimulatedClock:
    """Clock that advances only by `sleep`."""

    def __init__(self) -> None:
        self._start = datetime.now(UTC)
        self._elapsed_s = 0.0

    def now_s(self) -> float:
        """Return the simulated seconds since the clock was created."""
        return self._elapsed_s

    def utc(self) -> datetime:
        """Return the creation date plus the simulated seconds."""
        return self._start + timedelta(seconds=self._elapsed_s)

    def sleep(self, seconds: float) -> None:
        """Advance by `seconds` without waiting; negative values count as 0."""
        self._elapsed_s += max(0.0, seconds)
