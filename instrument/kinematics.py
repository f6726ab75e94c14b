"""Velocity profiles of a rotary axis, a move and a stop: duration, and position meanwhile."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Trapezoid:
    """Move over a signed distance from rest to rest, accelerating and decelerating evenly."""

    distance_deg: float
    speed_deg_per_s: float
    acceleration_deg_per_s2: float

    @property
    def _ramp_s(self) -> float:
        """Duration of the acceleration in s; a short move never reaches the top speed."""
        to_speed = self.speed_deg_per_s / self.acceleration_deg_per_s2
        return min(to_speed, math.sqrt(abs(self.distance_deg) / self.acceleration_deg_per_s2))

    @property
    def duration_s(self) -> float:
        """Seconds from rest to rest; 0 for no distance, or one whose square root underflows."""
        top = self.acceleration_deg_per_s2 * self._ramp_s
        if top == 0:
            return 0.0
        return self._ramp_s + abs(self.distance_deg) / top

    def speed_at(self, time_s: float) -> float:
        """Return the signed speed in deg/s `time_s` after the start."""
        left_s = self.duration_s - time_s
        ramped_s = max(min(time_s, left_s, self._ramp_s), 0.0)
        return math.copysign(self.acceleration_deg_per_s2 * ramped_s, self.distance_deg)

    def travelled_deg(self, time_s: float) -> float:
        """Return the signed distance in degrees covered `time_s` after the start."""
        duration, ramp = self.duration_s, self._ramp_s
        time_s = min(max(time_s, 0.0), duration)
        if time_s <= ramp:
            covered_deg = self.acceleration_deg_per_s2 * time_s**2 / 2
        elif time_s >= duration - ramp:
            left_s = duration - time_s
            covered_deg = abs(self.distance_deg) - self.acceleration_deg_per_s2 * left_s**2 / 2
        else:
            covered_deg = self.acceleration_deg_per_s2 * ramp * (time_s - ramp / 2)
        return math.copysign(covered_deg, self.distance_deg)


@dataclass(frozen=True, slots=True)
class Braking:
    """Even deceleration from a signed speed to rest."""

    from_deg_per_s: float
    deceleration_deg_per_s2: float

    @property
    def duration_s(self) -> float:
        """Seconds until rest."""
        return abs(self.from_deg_per_s) / self.deceleration_deg_per_s2

    @property
    def distance_deg(self) -> float:
        """Signed distance in degrees until rest."""
        return self.travelled_deg(self.duration_s)

    def speed_at(self, time_s: float) -> float:
        """Return the signed speed in deg/s `time_s` after the stop."""
        left_s = max(self.duration_s - time_s, 0.0)
        return math.copysign(self.deceleration_deg_per_s2 * left_s, self.from_deg_per_s)

    def travelled_deg(self, time_s: float) -> float:
        """Return the signed distance in degrees covered `time_s` after the stop."""
        time_s = min(max(time_s, 0.0), self.duration_s)
        mean_deg_per_s = abs(self.from_deg_per_s) - self.deceleration_deg_per_s2 * time_s / 2
        return math.copysign(time_s * mean_deg_per_s, self.from_deg_per_s)
