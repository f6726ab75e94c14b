"""The lamp's drift, followed by repeated checks of one geometry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from instrument.geometry import FloatArray
from instrument.record import Reading


@dataclass(frozen=True, slots=True)
class Drift:
    """The lamp's level relative to the first check; without checks it is 1 throughout.

    `u_level` is the relative standard uncertainty of a level between the checks.
    """

    times_s: FloatArray
    level: FloatArray
    u_level: float

    @classmethod
    def of(cls, readings: Sequence[Reading], block: int) -> Drift:
        """From the unflagged checks made in one block of the plan."""
        checks = [r for r in readings if r.kind == "drift" and r.block == block and not r.flags]
        rates = np.array([rate(r) for r in checks])
        times = np.array([r.time_s for r in checks])
        # The same geometry again: placement and rounding are the same each time, noise is not.
        noise = [r.u_noise_dn / r.signal_dn for r in checks]
        u_level = float(np.sqrt(2.0) * np.median(noise)) if noise else 0.0  # a ratio of two
        return cls(times, rates / rates[0] if rates.size else rates, u_level)

    @property
    def _slope_per_s(self) -> float:
        """Mean change over all checks."""
        if self.times_s.size < 2:
            return 0.0
        return float((self.level[-1] - self.level[0]) / (self.times_s[-1] - self.times_s[0]))

    def _outside_s(self, time_s: float) -> float:
        """Seconds from the nearest check, negative before the first, 0 between them."""
        return float(time_s - np.clip(time_s, self.times_s[0], self.times_s[-1]))

    def at(self, time_s: float) -> float:
        """Level by straight lines between the checks, and by the mean slope beyond them."""
        if not self.times_s.size:
            return 1.0
        inside = float(np.interp(time_s, self.times_s, self.level))
        return inside + self._slope_per_s * self._outside_s(time_s)

    def u_beyond(self, time_s: float) -> float:
        """Standard uncertainty of the level beyond the checks: half of what was extrapolated."""
        if not self.times_s.size:
            return 0.0
        return abs(self._slope_per_s * self._outside_s(time_s)) / 2


def rate(reading: Reading) -> float:
    """Counts (DN) per second, less the dark."""
    return reading.signal_dn / reading.exposure_s
