"""Motor whose motions are logged, and which moves while it is homing.

A motion is known in advance, so the log says when the axis stands, however late anybody looks.
"""

from __future__ import annotations

from dataclasses import dataclass

from instrument.clock import Clock
from instrument.kinematics import Braking
from sim.emulated.motor import Mechanics, Motor


@dataclass(frozen=True, slots=True)
class Motion:
    """One motion: `kind` is move, home or brake; times of the monotonic clock, in s."""

    kind: str
    begun_s: float
    ends_s: float
    from_deg: float
    to_deg: float


@dataclass(frozen=True, slots=True)
class Glide:
    """Even motion over a signed distance; it can stand in for a `Trapezoid`."""

    distance_deg: float
    duration_s: float

    def travelled_deg(self, time_s: float) -> float:
        """Return the signed distance in degrees covered `time_s` after the start."""
        return self.distance_deg * min(max(time_s / self.duration_s, 0.0), 1.0)

    def speed_at(self, time_s: float) -> float:
        """Return the signed speed in deg/s `time_s` after the start."""
        return self.distance_deg / self.duration_s if 0 <= time_s < self.duration_s else 0.0


class TrueMotor(Motor):
    """Axis at `start_deg`; `referenced`: its controller knows the reference already."""

    def __init__(
        self, mechanics: Mechanics, clock: Clock, start_deg: float, referenced: bool
    ) -> None:
        super().__init__(mechanics, clock)
        self._start_deg, self.referenced = start_deg, referenced
        self.motions: list[Motion] = []

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
            speed = self._move.speed_at(self._clock.now_s() - self._start_s)
            self._begin_at_position()
            self._homing_until_s = None
            self._move = Braking(speed, self.mechanics.acceleration_deg_per_s2)
            if moved:
                self._note("brake")

    def halt(self) -> None:
        with self._lock:
            moved = self.moving
            super().halt()
            self._start_s = self._clock.now_s()
            if moved:
                self._note("brake")

    def _begin_at_position(self) -> None:
        self._start_deg, self._start_s = self.position_deg, self._clock.now_s()

    def _note(self, kind: str) -> None:
        begun_s, way = self._start_s, self._move
        from_deg, ends_s = self._start_deg, begun_s + way.duration_s
        self.motions.append(Motion(kind, begun_s, ends_s, from_deg, from_deg + way.distance_deg))
