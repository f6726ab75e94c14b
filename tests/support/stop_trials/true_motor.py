"""Motor whose motions are logged, which brakes on a ramp and moves while it is homing.

A motion is known in advance, so the log says when the axis stands, however late anybody looks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from instrument.clock import Clock
from sim.emulated.motor import Mechanics, Motor

_STEP_S = 1e-4  # over which a speed is taken


@dataclass(frozen=True, slots=True)
class Motion:
    """One motion: `kind` is move, home or brake; times of the monotonic clock, in s."""

    kind: str
    begun_s: float
    ends_s: float
    from_deg: float
    to_deg: float


@dataclass(frozen=True, slots=True)
class Braking:
    """Way from a signed speed to rest; it can stand in for a `Trapezoid`."""

    speed_deg_per_s: float
    deceleration_deg_per_s2: float

    @property
    def duration_s(self) -> float:
        return abs(self.speed_deg_per_s) / self.deceleration_deg_per_s2

    @property
    def distance_deg(self) -> float:
        return self.speed_deg_per_s * self.duration_s / 2

    def travelled_deg(self, time_s: float) -> float:
        """Return the signed distance in degrees covered `time_s` after the stop."""
        time_s = min(max(time_s, 0.0), self.duration_s)
        lost = math.copysign(self.deceleration_deg_per_s2, self.speed_deg_per_s) * time_s**2 / 2
        return self.speed_deg_per_s * time_s - lost


@dataclass(frozen=True, slots=True)
class Glide:
    """Even motion over a signed distance; it can stand in for a `Trapezoid`."""

    distance_deg: float
    duration_s: float

    def travelled_deg(self, time_s: float) -> float:
        """Return the signed distance in degrees covered `time_s` after the start."""
        return self.distance_deg * min(max(time_s / self.duration_s, 0.0), 1.0)


class TrueMotor(Motor):
    """Axis at `start_deg`; `referenced`: its controller knows the reference already."""

    def __init__(
        self, mechanics: Mechanics, clock: Clock, start_deg: float, referenced: bool
    ) -> None:
        super().__init__(mechanics, clock)
        self._start_deg, self.referenced = start_deg, referenced
        self.motions: list[Motion] = []

    @property
    def _speed_deg_per_s(self) -> float:
        since_s = self._clock.now_s() - self._start_s
        begin_s, end_s = max(since_s - _STEP_S, 0.0), since_s + _STEP_S
        covered_deg = self._move.travelled_deg(end_s) - self._move.travelled_deg(begin_s)
        return covered_deg / (end_s - begin_s)

    def move(self, angle_deg: float) -> None:
        with self._lock:
            super().move(angle_deg)
            self._note("move")

    def home(self) -> None:
        with self._lock:
            self._begin_at_position()
            self.referenced = False
            duration_s = self.mechanics.homing_s
            way: object = Glide(self.mechanics.home_deg - self._start_deg, duration_s)
            self._move = way  # type: ignore[assignment]  # it has what the base class needs
            self._homing_until_s = self._start_s + duration_s
            self._note("home")

    def stop(self) -> None:
        with self._lock:
            moved = self.moving
            way: object = Braking(
                self._speed_deg_per_s if moved else 0.0, self.mechanics.acceleration_deg_per_s2
            )
            self._begin_at_position()
            self._homing_until_s = None
            self._move = way  # type: ignore[assignment]  # it has what the base class needs
            if moved:
                self._note("brake")

    def _begin_at_position(self) -> None:
        self._start_deg, self._start_s = self.position_deg, self._clock.now_s()

    def _note(self, kind: str) -> None:
        begun_s, way = self._start_s, self._move
        from_deg, ends_s = self._start_deg, begun_s + way.duration_s
        self.motions.append(Motion(kind, begun_s, ends_s, from_deg, from_deg + way.distance_deg))
