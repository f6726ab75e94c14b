"""The lamp's drift, followed by repeated checks of one geometry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from instrument.geometry import FloatArray
from instrument.record import Reading

LEAST_SIGNAL_U = 10.0  # a check with less signal than this many u follows noise and not the lamp


@dataclass(frozen=True, slots=True)
class Drift:
    """The lamp's level in one block relative to its first check; without checks 1 throughout.

    times_s, level, u_relative: one entry a check; u_relative is the noise of that check.
    """

    times_s: FloatArray
    level: FloatArray
    u_relative: FloatArray

    @classmethod
    def of(cls, readings: Sequence[Reading], block: int) -> Drift:
        """From the usable checks made in one block of the plan."""
        checks = [r for r in readings if r.kind == "drift" and r.block == block and usable(r)]
        rates = np.array([rate(r) for r in checks])
        return cls(
            np.array([r.time_s for r in checks]),
            rates / rates[0] if rates.size else rates,
            # The same geometry again: placement and rounding are the same each time, noise is not.
            np.array([r.u_noise_dn / r.signal_dn for r in checks]),
        )

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

    def shifts(self, time_s: float) -> FloatArray:
        """What one standard deviation of each check's noise does to a value corrected by `at`.

        Relative; a value between two checks has a part of both, and every value the opposite of
        the first one's, to which the levels are referred.
        """
        shares = np.array([np.interp(time_s, self.times_s, row) for row in np.eye(len(self.level))])
        if shares.size:
            shares[0] -= 1.0
        return -shares * self.u_relative


def usable(check: Reading) -> bool:
    """Whether a drift check shows the lamp: nothing flagged, and far more signal than noise."""
    return not check.flags and check.signal_dn > max(LEAST_SIGNAL_U * check.u_noise_dn, 0.0)


def rate(reading: Reading) -> float:
    """Counts (DN) per second, less the dark."""
    return reading.signal_dn / reading.exposure_s
