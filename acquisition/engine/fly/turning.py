"""Mean angle of a frame that was exposed while an axis turned, from time stamps.

The axis is asked for its position just before a frame is requested and just after it has come. Each
answer belongs to the middle of its exchange, within half of that: a uniform distribution of that
half-width has u = half-width / sqrt(3) (GUM 4.3.7). In between the axis turns evenly, and the mean
over the exposure is the angle at its middle. The frame's time stamp, of the camera or of its
arrival, is off the middle by a constant, which is part of the latency.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from acquisition.engine.axis import Axis
from instrument.clock import Clock
from instrument.devices import Frame

_UNEVEN = 0.1  # share of a turn by which it may depart from the one commanded, or the tolerance


@dataclass(frozen=True, slots=True)
class Sample:
    """Angle in degrees that an axis reported at a time of the clock, and that time's u, in s."""

    angle_deg: float
    time_s: float
    u_time_s: float


def sample(axis: Axis, clock: Clock) -> Sample:
    """Ask an axis for its angle."""
    before_s = clock.now_s()
    angle_deg = axis.position_deg()
    after_s = clock.now_s()
    return Sample(angle_deg, (before_s + after_s) / 2, (after_s - before_s) / math.sqrt(12))


@dataclass(frozen=True, slots=True)
class Shot:
    """Frame between two samples of the axis, which turned at `speed_deg_per_s` (signed)."""

    frame: Frame
    before: Sample
    after: Sample
    speed_deg_per_s: float

    @property
    def middle_s(self) -> float:
        """Time of the clock at the middle of the exposure, but for the latency."""
        stamp_s = self.frame.device_time_s
        end_s = self.frame.time_s if stamp_s is None else stamp_s
        return end_s - self.frame.exposure_s / 2

    @property
    def reported_deg(self) -> float:
        """Angle that the axis reported at the middle of the exposure."""
        first, last = self.before, self.after
        if last.time_s <= first.time_s:
            return first.angle_deg
        share = (self.middle_s - first.time_s) / (last.time_s - first.time_s)
        return first.angle_deg + share * (last.angle_deg - first.angle_deg)

    @property
    def blur_deg(self) -> float:
        """Angle by which the axis turned during the exposure."""
        return abs(self.speed_deg_per_s) * self.frame.exposure_s

    @property
    def u_deg(self) -> float:
        """Standard uncertainty of the reported angle by the times of the samples."""
        u_time_s = max(self.before.u_time_s, self.after.u_time_s)
        return abs(self.speed_deg_per_s) * u_time_s

    def unevenness_deg(self) -> float:
        """Difference between the turn from sample to sample and the one commanded."""
        elapsed_s = self.after.time_s - self.before.time_s
        turned_deg = self.after.angle_deg - self.before.angle_deg
        return turned_deg - self.speed_deg_per_s * elapsed_s

    def is_even(self, tolerance_deg: float) -> bool:
        """True if the axis turned as commanded, within a tenth or the tolerance of a position."""
        turn_deg = abs(self.speed_deg_per_s) * (self.after.time_s - self.before.time_s)
        allowed_deg = max(tolerance_deg, _UNEVEN * turn_deg) + 4 * self.u_deg
        return abs(self.unevenness_deg()) <= allowed_deg
