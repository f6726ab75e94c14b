"""How long a rotary axis takes: constant acceleration, cruise, constant deceleration."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Trapezoid:
    """A move over `distance_deg` (signed) at a top speed and an acceleration, from rest to rest."""

    distance_deg: float
    speed_deg_per_s: float
    acceleration_deg_per_s2: float

    @property
    def _ramp_s(self) -> float:
        """Time of the acceleration; a short move never reaches the top speed."""
        to_speed = self.speed_deg_per_s / self.acceleration_deg_per_s2
        return min(to_speed, math.sqrt(abs(self.distance_deg) / self.acceleration_deg_per_s2))

    @property
    def duration_s(self) -> float:
        """Seconds from rest to rest; none over no way, or over one too short for a float's root."""
        top = self.acceleration_deg_per_s2 * self._ramp_s
        if top == 0:
            return 0.0
        return self._ramp_s + abs(self.distance_deg) / top

    def travelled_deg(self, time_s: float) -> float:
        """Signed degrees covered `time_s` after the start."""
        duration, ramp = self.duration_s, self._ramp_s
        time_s = min(max(time_s, 0.0), duration)
        if time_s <= ramp:
            way = self.acceleration_deg_per_s2 * time_s**2 / 2
        elif time_s >= duration - ramp:
            left_s = duration - time_s
            way = abs(self.distance_deg) - self.acceleration_deg_per_s2 * left_s**2 / 2
        else:
            way = self.acceleration_deg_per_s2 * ramp * (time_s - ramp / 2)
        return math.copysign(way, self.distance_deg)
