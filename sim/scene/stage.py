"""Simulated rotary stage: trapezoidal motion in simulated time; writes its angle to the scene."""

from __future__ import annotations

from collections.abc import Callable

from instrument.clock import Clock
from instrument.config.axes import SimulatedAxis
from instrument.errors import DeviceError
from instrument.kinematics import Trapezoid
from sim.scene.scene import Scene


class SimulatedStage:
    """One motorised axis, in device degrees: `zero_deg` is the reading at rig angle 0."""

    def __init__(self, name: str, axis: SimulatedAxis, scene: Scene, clock: Clock) -> None:
        self._name, self._axis, self._scene, self._clock = name, axis, scene, clock
        self._homed, self._speed_deg_per_s = False, axis.speed_deg_per_s
        self._latency_s = scene.rig.simulation.axis_defects[name].latency_s
        self._start_deg = axis.zero_deg
        self._move = self._trapezoid(0.0)
        self._start_s = 0.0

    def identity(self) -> str:
        """Return a description with axis name and speed."""
        return f"simulated stage {self._name}, {self._axis.speed_deg_per_s:g} deg/s"

    def home(self) -> None:
        """Find the reference."""
        self._clock.sleep(self._axis.homing_s)
        self._homed, self._speed_deg_per_s = True, self._axis.speed_deg_per_s
        self._start_deg = self._axis.to_device_deg(self._axis.home_deg)
        self._move = self._trapezoid(0.0)
        self._write_scene()

    def homed(self) -> bool:
        """Return True once `home` has been called."""
        return self._homed

    def settings(self) -> dict[str, str]:
        """Return limits, speed and acceleration."""
        low, high = self.limits_deg()
        axis = self._axis
        return {
            "limits_deg": f"{low:g} to {high:g}",
            "speed_deg_per_s": f"{axis.speed_deg_per_s:g}",
            "acceleration_deg_per_s2": f"{axis.acceleration_deg_per_s2:g}",
        }

    def set_speed(self, speed_deg_per_s: float) -> None:
        """Set the speed of later moves; raise `DeviceError` above the rig file's."""
        full = self._axis.speed_deg_per_s
        if not 0 < speed_deg_per_s <= full * (1 + 1e-9):
            raise DeviceError(
                f"stage {self._name}: {speed_deg_per_s:g} deg/s asked for; allowed: more than 0, "
                f"up to {full:g} deg/s, the rig file's"
            )
        self._speed_deg_per_s = speed_deg_per_s

    def start_move(self, angle_deg: float) -> None:
        """Start a move; raise `DeviceError` if not homed or beyond the rig file's limits."""
        if not self._homed:
            raise DeviceError(f"stage {self._name}: not homed: home it before moving it")
        low, high = self.limits_deg()
        if not low - 1e-9 <= angle_deg <= high + 1e-9:
            raise DeviceError(
                f"stage {self._name}: {angle_deg:g} deg asked for; its limits are {low:g} to "
                f"{high:g} deg (in device degrees): nothing has moved"
            )
        now_s = self._clock.now_s()
        self._start_deg = self._at_deg(now_s)
        self._move = self._trapezoid(angle_deg - self._start_deg)
        self._start_s = now_s
        self._scene.motions[self._name] = self._motion()

    def wait(self) -> float:
        """Let the move finish and return the position in degrees."""
        self._clock.sleep(self._start_s + self._move.duration_s - self._clock.now_s())
        return self._halt()

    def position_deg(self) -> float:
        """Return the position, also during a move: of `latency_s` ago, as the rig file says."""
        return self._at_deg(self._clock.now_s() - self._latency_s)

    def limits_deg(self) -> tuple[float, float]:
        """Return the rig file's limits in device degrees."""
        return self._axis.device_limits_deg()

    def begin_stop(self) -> None:
        """End the move at the current position."""
        self._halt()

    def finish_stop(self) -> None:
        """Do nothing: a simulated stage stands at once."""

    def stop(self) -> None:
        """End the move at the current position."""
        self._halt()

    def close(self) -> None:
        """Do nothing: there is nothing to release."""

    def _halt(self) -> float:
        self._start_deg = self._at_deg(self._clock.now_s())
        self._move = self._trapezoid(0.0)
        self._write_scene()
        return self._start_deg

    def _at_deg(self, time_s: float) -> float:
        return self._start_deg + self._move.travelled_deg(time_s - self._start_s)

    def _motion(self) -> Callable[[float], float]:
        """Return the angle of the rig at a time of the clock, for the move that has begun."""
        start_deg, move, start_s = self._start_deg, self._move, self._start_s
        convert = self._axis.from_device_deg
        return lambda time_s: convert(start_deg + move.travelled_deg(time_s - start_s))

    def _trapezoid(self, distance_deg: float) -> Trapezoid:
        return Trapezoid(distance_deg, self._speed_deg_per_s, self._axis.acceleration_deg_per_s2)

    def _write_scene(self) -> None:
        self._scene.motions.pop(self._name, None)
        self._scene.set_axis(self._name, self._axis.from_device_deg(self._start_deg))
