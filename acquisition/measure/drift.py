"""Drift of the lamp, interpolated between repeated readings of one geometry (drift checks)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from acquisition.measure.radiometry import FEW_PIXELS, LEAVES_FRAME
from acquisition.measure.type_a import scatter_ratio
from instrument.geometry import FloatArray, IntArray
from instrument.record.reading import Check, Reading

MIN_SIGNAL_U = 10.0  # with less signal, in u, a check shows no light of the lamp
JUMP_U, MIN_JUMP = 4.0, 0.003  # a jump exceeds both: in u, and relative
# Changes of a lamp that warms up, before two checks show a trend: at once, per s, and at most
# (assumed).
_WARM_UP_STEP, _WARM_UP_PER_S, _WARM_UP = 0.005, 1.0 / 3600.0, 0.02


@dataclass(frozen=True)
class _Segment:
    """Checks between which the lamp drifts steadily.

    times_s, level, u_relative: one entry a check, the level relative to the block's first check.
    scatter: of the checks about a steady drift, in units of their noise, which `u_relative` has.
    """

    times_s: FloatArray
    level: FloatArray
    u_relative: FloatArray
    scatter: float = 1.0

    @classmethod
    def of(cls, checks: Sequence[Reading], first_rate: float) -> _Segment:
        times_s = np.array([r.time_s for r in checks])
        level = np.array([rate(r) / first_rate for r in checks])
        # Same geometry each time: only the noise differs, not placement or rounding.
        noise = np.array([r.u_noise_dn / r.signal_dn for r in checks])
        by_noise = cls(times_s, level, noise)
        if by_noise.u_between.any():  # a jump has an uncertainty of its own
            return by_noise
        scatter = scatter_ratio(times_s, level, noise)
        return cls(times_s, level, noise * scatter, scatter)

    @cached_property
    def u_wander(self) -> float:
        """Standard uncertainty of a level by what the checks scatter beyond noise, relative."""
        wander = float(np.median(self.u_relative)) * math.sqrt(1 - self.scatter**-2)
        return wander if self.scatter > 1 else 0.0

    @cached_property
    def trend_per_s(self) -> float:
        """Mean change of the level over all checks."""
        if self.times_s.size < 2:
            return 0.0
        return float((self.level[-1] - self.level[0]) / (self.times_s[-1] - self.times_s[0]))

    def outside_s(self, time_s: float) -> float:
        """Return the signed time to the nearest check, 0 between the first and the last."""
        first_s, last_s = float(self.times_s[0]), float(self.times_s[-1])
        return float(time_s - min(max(time_s, first_s), last_s))

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

    @property
    def u_between(self) -> FloatArray:
        """Standard uncertainty of a level between two checks, (checks - 1,), relative.

        A change that the intervals beside it do not share may have come at any moment of its own
        interval: of a step J, interpolated by a straight line, J / sqrt(6) is left on average. What
        is no jump, by `JUMP_U` and `MIN_JUMP`, counts as steady.
        """
        apart_s, changes = np.diff(self.times_s), np.diff(self.level)
        rates, u_rates = (
            np.divide(part, apart_s, out=np.zeros(changes.size), where=apart_s > 0)
            for part in (changes, np.full(changes.size, math.sqrt(2) * np.max(self.u_relative)))
        )
        beside, u_beside = _rates_beside(rates, u_rates)
        unshared = np.abs(rates - beside) * apart_s
        noise = JUMP_U * np.hypot(u_rates, u_beside) * apart_s
        jumps: FloatArray = np.where(unshared > np.maximum(noise, MIN_JUMP), unshared, 0.0)
        return jumps / math.sqrt(6)

    def interpolation(self, times_s: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return for times (N,) the index of the preceding check and the next one's weight."""
        last = self.times_s.size - 1
        before = np.clip(np.searchsorted(self.times_s, times_s, side="right") - 1, 0, last)
        after = np.minimum(before + 1, last)
        apart_s = self.times_s[after] - self.times_s[before]
        since_s = np.clip(times_s - self.times_s[before], 0.0, apart_s)
        weight = np.divide(since_s, apart_s, out=np.zeros(times_s.size), where=apart_s > 0)
        return before.astype(np.int64), weight


def _rates_beside(rates: FloatArray, u_rates: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean rate of change of the intervals beside each, (N,), and its uncertainty.

    A single interval is compared with a constant level.
    """
    if rates.size < 2:
        return np.zeros(rates.size), np.zeros(rates.size)
    mean, u_mean = (rates[:-2] + rates[2:]) / 2, np.hypot(u_rates[:-2], u_rates[2:]) / 2
    return (
        np.concatenate([rates[1:2], mean, rates[-2:-1]]),
        np.concatenate([u_rates[1:2], u_mean, u_rates[-2:-1]]),
    )


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

    @property
    def scatter(self) -> float:
        """Scatter of the checks about a steady drift, in units of their noise; at least 1."""
        return max((segment.scatter for segment in self.segments), default=1.0)

    def u_wander(self, time_s: float) -> float:
        """Return the relative standard uncertainty of a level for what checks scatter at random."""
        segment = self._segment(time_s)
        return 0.0 if segment is None else segment.u_wander

    def at(self, time_s: float) -> float:
        """Return the relative level at a time of the scan."""
        segment = self._segment(time_s)
        return 1.0 if segment is None else segment.at(time_s)

    def u_extrapolated(self, time_s: float) -> float:
        """Return the standard uncertainty of a level for being extrapolated; 0 between checks."""
        segment = self._segment(time_s)
        return 0.0 if segment is None else segment.u_extrapolated(time_s)

    def u_between(self, times_s: FloatArray) -> FloatArray:
        """Return the relative standard uncertainty, (N,), of levels at times (N,) in s.

        It is 0 outside the checks.
        """
        u = np.zeros(times_s.size)
        for segment in self.segments:
            own = np.searchsorted(segment.times_s, times_s) - 1
            inside = (own >= 0) & (times_s <= segment.times_s[-1])
            u[inside] = segment.u_between[own[inside]]
        return u

    def predicted_rate(self, time_s: float) -> tuple[float, float]:
        """Return the counts per second expected of a check at that time, and their relative u."""
        last = self.segments[-1]
        u_relative = math.hypot(float(last.u_relative[-1]), self.u_extrapolated(time_s))
        if last.times_s.size < 2:
            u_relative = math.hypot(u_relative, u_unknown_trend(last.outside_s(time_s)))
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
        begun = (s for s in reversed(self.segments[1:]) if s.times_s[0] < time_s)
        return next(begun, self.segments[0] if self.segments else None)


def u_unknown_trend(apart_s: float) -> float:
    """Return the standard uncertainty of a lamp's relative level after a time, trend unknown.

    A lamp that warms up may change by four times as much (`JUMP_U`): 0.5 %, 1.7 % more a minute,
    and 2 % in all. What changes more has jumped, or is not warm enough to measure with.
    """
    return min(_WARM_UP_STEP + _WARM_UP_PER_S * abs(apart_s), _WARM_UP) / JUMP_U


def is_usable(check: Reading) -> bool:
    """Return True if a drift check has no flags and a signal far above its uncertainty."""
    return not check.flags and check.signal_dn > max(MIN_SIGNAL_U * check.u_light_dn, 0.0)


def is_misplaced(reading: Reading) -> bool:
    """Return True for a reading without a window to speak of: it says nothing about the lamp."""
    return bool({LEAVES_FRAME, FEW_PIXELS} & set(reading.flags.split("; ")))


def rate(reading: Reading) -> float:
    """Return the counts (DN) per second, dark subtracted."""
    return reading.signal_dn / reading.exposure_s
