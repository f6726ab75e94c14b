"""Motion behind an emulated controller: the axis position from kinematics and a clock."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

from instrument.clock import Clock
from instrument.kinematics import Braking, Trapezoid


@dataclass(frozen=True, slots=True, kw_only=True)
class Mechanics:
    """Limits, speed and homing of an axis, in device degrees."""

    min_deg: float = -180.0
    max_deg: float = 180.0
    speed_deg_per_s: float = 20.0
    acceleration_deg_per_s2: float = 40.0
    home_deg: float = 0.0
    homing_s: float = 0.5


class Motor:
    """One axis, thread-safe: the controller drives it while the scene reads its position.

    `alarm`: fault code as the controller reports it, "" for none; `homing_fails`: homing never
    ends.
    """

    def __init__(self, mechanics: Mechanics, clock: Clock) -> None:
        self.mechanics, self._clock = mechanics, clock
        self._lock = threading.RLock()
        self._start_deg = mechanics.home_deg + 0.37  # any position but home
        self._move: Trapezoid | Braking = self._trapezoid(0.0)
        self._start_s = clock.now_s()
        self._homing_until_s: float | None = None
        self._held_deg: float | None = None
        self.referenced = False
        self.alarm = ""
        self.homing_fails = False

    @property
    def position_deg(self) -> float:
        """Current position in degrees."""
        with self._lock:
            self._finish_homing()
            if self._held_deg is not None:
                return self._held_deg
            return self._start_deg + self._move.travelled_deg(self._clock.now_s() - self._start_s)

    @property
    def homing(self) -> bool:
        """True while the axis searches for its reference."""
        with self._lock:
            self._finish_homing()
            return self._homing_until_s is not None

    @property
    def moving(self) -> bool:
        """True while the controller takes the axis to be moving; a held axis never arrives."""
        with self._lock:
            if self.homing:
                return True
            held = self._held_deg is not None and self._move.distance_deg != 0
            return held or self._clock.now_s() - self._start_s < self._move.duration_s

    def motion(self) -> Callable[[float], float] | None:
        """Position in degrees by the clock's time, of the move under way; None without one."""
        with self._lock:
            if self.homing or self._held_deg is not None or not self.moving:
                return None
            start_deg, move, start_s = self._start_deg, self._move, self._start_s
        return lambda time_s: start_deg + move.travelled_deg(time_s - start_s)

    def home(self) -> None:
        """Start searching for the reference."""
        with self._lock:
            self.halt()
            self.referenced = False
            duration_s = float("inf") if self.homing_fails else self.mechanics.homing_s
            self._homing_until_s = self._clock.now_s() + duration_s

    def move(self, angle_deg: float) -> None:
        """Start a move."""
        with self._lock:
            self._start_deg = self.position_deg
            self._move = self._trapezoid(angle_deg - self._start_deg)
            self._start_s = self._clock.now_s()

    def set_speed(self, speed_deg_per_s: float, acceleration_deg_per_s2: float) -> None:
        """Set speed and acceleration of later moves."""
        with self._lock:
            self.mechanics = replace(
                self.mechanics,
                speed_deg_per_s=speed_deg_per_s,
                acceleration_deg_per_s2=acceleration_deg_per_s2,
            )

    def end_move(self) -> None:
        """Complete the move at once."""
        with self._lock:
            self._start_deg += self._move.distance_deg
            self._move = self._trapezoid(0.0)

    def stop(self) -> None:
        """Brake by the set acceleration; a search for the reference stops at once."""
        with self._lock:
            now_s = self._clock.now_s()
            speed = self._move.speed_at(now_s - self._start_s) if self._held_deg is None else 0.0
            self.halt()
            self._move = Braking(speed, self.mechanics.acceleration_deg_per_s2)
            self._start_s = now_s

    def halt(self) -> None:
        """Stop at the current position."""
        with self._lock:
            self._start_deg, self._homing_until_s = self.position_deg, None
            self._move = self._trapezoid(0.0)
            self._held_deg = None

    def hold(self) -> None:
        """Block the axis at its position, unnoticed by the controller."""
        with self._lock:
            at_deg = self.position_deg
            if not self.moving:  # a finished move cannot be held
                self._start_deg, self._move = at_deg, self._trapezoid(0.0)
            self._held_deg = at_deg

    def push(self, by_deg: float) -> None:
        """Turn the axis by an external force; its encoder shows it."""
        with self._lock:
            self._start_deg += by_deg

    def lose_power(self) -> None:
        """Restart the controller: the axis stops and has no reference."""
        with self._lock:
            self.halt()
            self.referenced = False

    def fail(self, alarm: str) -> None:
        """Stop with a fault, given as the controller's own code."""
        with self._lock:
            self.halt()
            self.alarm = alarm

    def _finish_homing(self) -> None:
        until_s = self._homing_until_s
        if until_s is not None and self._clock.now_s() >= until_s:
            self._homing_until_s = None
            self._start_deg, self._move = self.mechanics.home_deg, self._trapezoid(0.0)
            self.referenced = True

    def _trapezoid(self, distance_deg: float) -> Trapezoid:
        m = self.mechanics
        return Trapezoid(distance_deg, m.speed_deg_per_s, m.acceleration_deg_per_s2)
