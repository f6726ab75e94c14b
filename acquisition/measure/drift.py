"""Drift of the lamp, interpolated between repeated readings of one geometry (drift checks)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from instrument.geometry import FloatArray, IntArray
from instrument.record.reading import Check, Reading

MIN_SIGNAL_U = 10.0  # with less signal, in u, a check shows noise and not the lamp
JUMP_U, MIN_JUMP = 4.0, 0.003  # a jump exceeds both: in u, and relative


@dataclass(frozen=True, slots=True)
class _Segment:
    """Checks between which the lamp drifts steadily.

    times_s, level, u_relative: one entry a check, the level relative to the block's first check.
    """

    times_s: FloatArray
    level: FloatArray
    u_relative: FloatArray

    @classmethod
    def of(cls, checks: Sequence[Reading], first_rate: float) -> _Segment:
        return cls(
            np.array([r.time_s for r in checks]),
            np.array([rate(r) / first_rate for r in checks]),
            # Same geometry each time: only the noise differs, not placement or rounding.
            np.array([r.u_noise_dn / r.signal_dn for r in checks]),
        )

    @property
    def trend_per_s(self) -> float:
        """Mean change of the level over all checks."""
        if self.times_s.size < 2:
            return 0.0
        return float((self.level[-1] - self.level[0]) / (self.times_s[-1] - self.times_s[0]))

    def outside_s(self, time_s: float) -> float:
        """Return the signed time to the nearest check, 0 between the first and the last."""
        return float(time_s - np.clip(time_s, self.times_s[0], self.times_s[-1]))

    def at(self, time_s: float) -> float:
        """Return the level: linear between the checks, extrapolated by the mean trend."""
        inside = float(np.interp(time_s, self.times_s, self.level))
        return inside + self.trend_per_s * self.outside_s(time_s)

    def u_extrapolated(self, time_s: float) -> float:
        """Return the standard uncertainty of an extrapolated level.

        That of a trend which changes steadily: a parabola that is `bend` off the mean trend in the
        middle of the checks, by more than twice their noise; and the noise of the mean trend. Two
        checks show no bend: then half of the extrapolation.
        """
        outside_s = abs(self.outside_s(time_s))
        if self.times_s.size < 3:
            return abs(self.trend_per_s * outside_s) / 2
        straight = self.level[0] + self.trend_per_s * (self.times_s - self.times_s[0])
        noise = float(np.max(self.u_relative))
        bend = max(float(np.max(np.abs(self.level - straight))) - 2 * noise, 0.0)
        share = outside_s / float(self.times_s[-1] - self.times_s[0])
        return math.hypot(4 * bend * share * (1 + share), math.sqrt(2) * noise * share)

    def interpolation(self, times_s: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return for times (N,) the index of the preceding check and the next one's weight."""
        last = self.times_s.size - 1
        before = np.clip(np.searchsorted(self.times_s, times_s, side="right") - 1, 0, last)
        after = np.minimum(before + 1, last)
        apart_s = self.times_s[after] - self.times_s[before]
        since_s = np.clip(times_s - self.times_s[before], 0.0, apart_s)
        weight = np.divide(since_s, apart_s, out=np.zeros(times_s.size), where=apart_s > 0)
        return before.astype(np.int64), weight


@dataclass(frozen=True, slots=True)
class Drift:
    """Level of the lamp in one block, relative to its first check; 1 without checks.

    segments: one, and another for each resume at which the lamp had jumped.
    first_rate: counts per second of the first check, the unit of the levels.
    """

    segments: tuple[_Segment, ...]
    first_rate: float

    @classmethod
    def of(cls, readings: Sequence[Reading], block: int, checks: Sequence[Check] = ()) -> Drift:
        """Return the drift from the usable checks of one block and those made at a resume."""
        planned = sorted(
            (r for r in readings if r.kind == "drift" and r.block == block and is_usable(r)),
            key=lambda r: r.time_s,
        )
        if not planned:
            return cls((), math.nan)
        jumps = [c for c in checks if c.jumped and c.reading.block == block]
        # By time: a reading that is measured again comes after later steps of the plan.
        bounds = [-math.inf, *(c.reading.time_s for c in jumps), math.inf]
        heads: list[list[Reading]] = [[], *([c.reading] for c in jumps)]
        groups = [
            [*head, *(r for r in planned if low < r.time_s <= high)]
            for head, low, high in zip(heads, bounds[:-1], bounds[1:], strict=True)
        ]
        first = rate(planned[0])
        return cls(tuple(_Segment.of(group, first) for group in groups if group), first)

    @property
    def level(self) -> FloatArray:
        """Level at every check, shape (checks,), relative to the first."""
        return np.concatenate([[], *(s.level for s in self.segments)])

    @property
    def u_relative(self) -> FloatArray:
        """Standard uncertainty due to noise of every check, shape (checks,), relative to it."""
        return np.concatenate([[], *(s.u_relative for s in self.segments)])

    def at(self, time_s: float) -> float:
        """Return the relative level at a time of the scan."""
        segment = self._segment(time_s)
        return 1.0 if segment is None else segment.at(time_s)

    def u_extrapolated(self, time_s: float) -> float:
        """Return the standard uncertainty of a level for being extrapolated; 0 between checks."""
        segment = self._segment(time_s)
        return 0.0 if segment is None else segment.u_extrapolated(time_s)

    def predicted_rate(self, time_s: float) -> tuple[float, float]:
        """Return the counts per second expected of a check at that time, and their relative u."""
        last = self.segments[-1]
        u_relative = math.hypot(float(last.u_relative[-1]), self.u_extrapolated(time_s))
        return self.first_rate * last.at(time_s), u_relative

    def interpolation(self, times_s: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return, for times (N,) in s, the index (N,) of the preceding check and a weight (N,).

        The weight, 0 to 1, is that of the next check in the level; the preceding one has the rest.
        Requires at least one check; the index counts through the block.
        """
        before, weight = self.segments[0].interpolation(times_s)
        passed = self.segments[0].level.size
        for segment in self.segments[1:]:
            own, part = segment.interpolation(times_s)
            begun = segment.times_s[0] < times_s
            before, weight = np.where(begun, own + passed, before), np.where(begun, part, weight)
            passed += segment.level.size
        return before, weight

    def _segment(self, time_s: float) -> _Segment | None:
        """Return the last segment that began before that time, or else the first."""
        begun = [s for s in self.segments[1:] if s.times_s[0] < time_s]
        return (*self.segments[:1], *begun)[-1] if self.segments else None


def is_usable(check: Reading) -> bool:
    """Return True if a drift check has no flags and a signal far above its noise."""
    return not check.flags and check.signal_dn > max(MIN_SIGNAL_U * check.u_noise_dn, 0.0)


def rate(reading: Reading) -> float:
    """Return the counts (DN) per second, dark subtracted."""
    return reading.signal_dn / reading.exposure_s
