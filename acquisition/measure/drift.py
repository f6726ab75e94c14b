"""The lamp's drift, followed by repeated checks of one geometry."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from instrument.geometry import FloatArray, IntArray
from instrument.record.reading import Check, Reading

LEAST_SIGNAL_U = 10.0  # a check with less signal than this many u follows noise and not the lamp
JUMP_U, LEAST_JUMP = 4.0, 0.003  # a lamp has jumped when it is off by more than both of these


@dataclass(frozen=True, slots=True)
class _Stretch:
    """Checks between which the lamp ages evenly.

    times_s, level, u_relative: one entry a check, the level relative to the block's first check.
    """

    times_s: FloatArray
    level: FloatArray
    u_relative: FloatArray

    @property
    def slope_per_s(self) -> float:
        """Mean change over all checks."""
        if self.times_s.size < 2:
            return 0.0
        return float((self.level[-1] - self.level[0]) / (self.times_s[-1] - self.times_s[0]))

    def outside_s(self, time_s: float) -> float:
        """Seconds from the nearest check, negative before the first, 0 between them."""
        return float(time_s - np.clip(time_s, self.times_s[0], self.times_s[-1]))

    def at(self, time_s: float) -> float:
        """Level by straight lines between the checks, and by the mean slope beyond them."""
        inside = float(np.interp(time_s, self.times_s, self.level))
        return inside + self.slope_per_s * self.outside_s(time_s)

    def between(self, times_s: FloatArray) -> tuple[IntArray, FloatArray]:
        """The check before each time, and how much the next one counts beside it (0 to 1)."""
        last = self.times_s.size - 1
        before = np.clip(np.searchsorted(self.times_s, times_s, side="right") - 1, 0, last)
        after = np.minimum(before + 1, last)
        apart_s = self.times_s[after] - self.times_s[before]
        since_s = np.clip(times_s - self.times_s[before], 0.0, apart_s)
        share = np.divide(since_s, apart_s, out=np.zeros(times_s.size), where=apart_s > 0)
        return before.astype(np.int64), share


@dataclass(frozen=True, slots=True)
class Drift:
    """The lamp's level in one block relative to its first check; without checks 1 throughout.

    stretches: one, and one more for each time that a scan went on with a lamp that had jumped.
    first_rate: counts per second of the first check, to which levels refer.
    """

    stretches: tuple[_Stretch, ...]
    first_rate: float

    @classmethod
    def of(cls, readings: Sequence[Reading], block: int, checks: Sequence[Check] = ()) -> Drift:
        """From the usable checks made in one block of the plan, and those at a resume."""
        made = [r for r in readings if r.kind == "drift" and r.block == block and usable(r)]
        if not made:
            return cls((), math.nan)
        jumps = [c for c in checks if c.jumped and c.reading.block == block]
        bounds = [-1, *(c.before_step for c in jumps), math.inf]
        heads: list[list[Reading]] = [[], *([c.reading] for c in jumps)]
        groups = [
            [*head, *(r for r in made if low <= r.step < high)]
            for head, low, high in zip(heads, bounds[:-1], bounds[1:], strict=True)
        ]
        first = rate(made[0])
        return cls(tuple(_stretch(group, first) for group in groups if group), first)

    @property
    def level(self) -> FloatArray:
        """The level at every check."""
        return np.concatenate([[], *(s.level for s in self.stretches)])

    def at(self, time_s: float) -> float:
        """The level at a time of the scan."""
        stretch = self._stretch(time_s)
        return 1.0 if stretch is None else stretch.at(time_s)

    def u_beyond(self, time_s: float) -> float:
        """Standard uncertainty of the level beyond the checks: half of what was extrapolated."""
        stretch = self._stretch(time_s)
        return 0.0 if stretch is None else abs(stretch.slope_per_s * stretch.outside_s(time_s)) / 2

    def foretold(self, time_s: float) -> tuple[float, float]:
        """Counts per second of the next check and their relative u, from the last one's."""
        last = self.stretches[-1]
        u_relative = math.hypot(float(last.u_relative[-1]), self.u_beyond(time_s))
        return self.first_rate * last.at(time_s), u_relative

    @property
    def u_relative(self) -> FloatArray:
        """Relative standard uncertainty of every check, of its noise alone."""
        return np.concatenate([[], *(s.u_relative for s in self.stretches)])

    def between(self, times_s: FloatArray) -> tuple[IntArray, FloatArray]:
        """The check before each time (N,), numbered through the block, and the next one's share.

        The share (0 to 1) is that in the level at the time; the rest is the earlier one's. There
        must be a check.
        """
        before, share = self.stretches[0].between(times_s)
        passed = self.stretches[0].level.size
        for stretch in self.stretches[1:]:
            own, part = stretch.between(times_s)
            begun = stretch.times_s[0] < times_s
            before, share = np.where(begun, own + passed, before), np.where(begun, part, share)
            passed += stretch.level.size
        return before, share

    def _stretch(self, time_s: float) -> _Stretch | None:
        """The one that began last before that time."""
        begun = [s for s in self.stretches[1:] if s.times_s[0] < time_s]
        return (*self.stretches[:1], *begun)[-1] if self.stretches else None


def _stretch(checks: Sequence[Reading], first_rate: float) -> _Stretch:
    return _Stretch(
        np.array([r.time_s for r in checks]),
        np.array([rate(r) / first_rate for r in checks]),
        # The same geometry again: placement and rounding are the same each time, noise is not.
        np.array([r.u_noise_dn / r.signal_dn for r in checks]),
    )


def usable(check: Reading) -> bool:
    """Whether a drift check shows the lamp: nothing flagged, and far more signal than noise."""
    return not check.flags and check.signal_dn > max(LEAST_SIGNAL_U * check.u_noise_dn, 0.0)


def rate(reading: Reading) -> float:
    """Counts (DN) per second, less the dark."""
    return reading.signal_dn / reading.exposure_s
