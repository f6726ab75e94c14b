"""The mechanics behind an emulated controller: where the axis is, by kinematics and a clock."""

from __future__ import annotations

import threading
from dataclasses import dataclass

from instrument.clock import Clock
from instrument.kinematics import Trapezoid


@dataclass(frozen=True, slots=True)
class Mechanics:
    """What an axis can do, in the device's own degrees."""

    min_deg: float = -180.0
    max_deg: float = 180.0
    speed_deg_per_s: float = 20.0
    acceleration_deg_per_s2: float = 40.0
    home_deg: float = 0.0
    homing_s: float = 0.5


class Motor:
    """One axis. Safe from several threads: the controller drives it, the scene looks at it."""

    def __init__(self, mechanics: Mechanics, clock: Clock) -> None:
        self.mechanics, self._clock = mechanics, clock
        self._lock = threading.RLock()
        self._from_deg = mechanics.home_deg + 0.37  # wherever it was left
        self._move = self._over(0.0)
        self._started_s = clock.now_s()
        self._homing_until_s: float | None = None
        self._held_deg: float | None = None
        self.referenced = False
        self.alarm = ""
        self.refuses_home = False

    @property
    def position_deg(self) -> float:
        """Where the axis is now."""
        with self._lock:
            self._finish_homing()
            if self._held_deg is not None:
                return self._held_deg
            return self._from_deg + self._move.travelled_deg(self._clock.now_s() - self._started_s)

    @property
    def homing(self) -> bool:
        """Whether it looks for its reference."""
        with self._lock:
            self._finish_homing()
            return self._homing_until_s is not None

    @property
    def moving(self) -> bool:
        """Whether its controller believes that it moves: a motor that is held never arrives."""
        with self._lock:
            if self.homing:
                return True
            held = self._held_deg is not None and self._move.distance_deg != 0
            return held or self._clock.now_s() - self._started_s < self._move.duration_s

    def home(self) -> None:
        """Begin to look for the reference."""
        with self._lock:
            self.stop()
            self.referenced = False
            forever = float("inf")
            takes_s = forever if self.refuses_home else self.mechanics.homing_s
            self._homing_until_s = self._clock.now_s() + takes_s

    def move(self, angle_deg: float) -> None:
        """Begin to move."""
        with self._lock:
            self._from_deg = self.position_deg
            self._move = self._over(angle_deg - self._from_deg)
            self._started_s = self._clock.now_s()

    def end_move(self) -> None:
        """The move has just come to its end."""
        with self._lock:
            self._from_deg += self._move.distance_deg
            self._move = self._over(0.0)

    def stop(self) -> None:
        """Stand still where it is."""
        with self._lock:
            self._from_deg, self._homing_until_s = self.position_deg, None
            self._move = self._over(0.0)
            self._held_deg = None

    def hold(self) -> None:
        """Something holds the axis: it gets no further, and its controller does not notice."""
        with self._lock:
            at_deg = self.position_deg
            if not self.moving:  # what has ended is no move that is held
                self._from_deg, self._move = at_deg, self._over(0.0)
            self._held_deg = at_deg

    def push(self, by_deg: float) -> None:
        """Something turns the axis away from where it stands; its encoder tells."""
        with self._lock:
            self._from_deg += by_deg

    def lose_power(self) -> None:
        """Its controller starts anew: it stands, and has no reference."""
        with self._lock:
            self.stop()
            self.referenced = False

    def fail(self, alarm: str) -> None:
        """The controller finds something wrong, named in its own code, and stops."""
        with self._lock:
            self.stop()
            self.alarm = alarm

    def _finish_homing(self) -> None:
        until_s = self._homing_until_s
        if until_s is not None and self._clock.now_s() >= until_s:
            self._homing_until_s = None
            self._from_deg, self._move = self.mechanics.home_deg, self._over(0.0)
            self.referenced = True

    def _over(self, distance_deg: float) -> Trapezoid:
        m = self.mechanics
        return Trapezoid(distance_deg, m.speed_deg_per_s, m.acceleration_deg_per_s2)
