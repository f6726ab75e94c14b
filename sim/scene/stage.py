"""The simulated rotary stage: moves by its kinematics in simulated time and writes the scene."""

from __future__ import annotations

from instrument.clock import Clock
from instrument.config.axes import SimulatedAxis
from instrument.errors import DeviceError
from instrument.kinematics import Trapezoid
from sim.scene.scene import Scene


class SimulatedStage:
    """One motor axis. Angles are the device's own: it reads `zero_deg` where the axis reads 0."""

    def __init__(self, name: str, axis: SimulatedAxis, scene: Scene, clock: Clock) -> None:
        self._name, self._axis, self._scene, self._clock = name, axis, scene, clock
        self._homed = False
        self._position_deg = axis.zero_deg
        self._move = Trapezoid(0.0, axis.speed_deg_per_s, axis.acceleration_deg_per_s2)
        self._started_s = 0.0

    def identity(self) -> str:
        """What this stage is."""
        axis = self._axis
        return f"simulated stage {self._name}, {axis.speed_deg_per_s:g} deg/s"

    def home(self) -> None:
        """Find the reference."""
        self._clock.sleep(self._axis.homing_s)
        self._homed = True
        self._position_deg = self._axis.to_device_deg(self._axis.home_deg)
        self._move = self._over(0.0)
        self._write_scene()

    def homed(self) -> bool:
        """Whether it was homed since it was made."""
        return self._homed

    def settings(self) -> dict[str, str]:
        """What it keeps to."""
        low, high = self.limits_deg()
        axis = self._axis
        return {
            "limits_deg": f"{low:g} to {high:g}",
            "speed_deg_per_s": f"{axis.speed_deg_per_s:g}",
            "acceleration_deg_per_s2": f"{axis.acceleration_deg_per_s2:g}",
        }

    def start_move(self, angle_deg: float) -> None:
        """Begin to move; refuses before homing and past the limits of the rig file."""
        if not self._homed:
            raise DeviceError(f"stage {self._name}: not homed, so it must not move: home it first")
        low, high = self.limits_deg()
        if not low - 1e-9 <= angle_deg <= high + 1e-9:
            raise DeviceError(
                f"stage {self._name}: {angle_deg:g} deg asked for; its limits are {low:g} to "
                f"{high:g} deg (the device's own degrees): nothing has moved"
            )
        self._position_deg = self._now_deg()
        self._move = self._over(angle_deg - self._position_deg)
        self._started_s = self._clock.now_s()

    def wait(self) -> float:
        """Let the move end and return the position in degrees."""
        left_s = self._started_s + self._move.duration_s - self._clock.now_s()
        self._clock.sleep(left_s)
        return self._arrive()

    def position_deg(self) -> float:
        """Where the stage is."""
        return self._now_deg()

    def limits_deg(self) -> tuple[float, float]:
        """The rig file's limits."""
        return self._axis.device_limits_deg()

    def stop(self) -> None:
        """End the move where the axis is now."""
        self._arrive()

    def close(self) -> None:
        """Nothing to let go of."""

    def _arrive(self) -> float:
        self._position_deg = self._now_deg()
        self._move = self._over(0.0)
        self._write_scene()
        return self._position_deg

    def _over(self, distance_deg: float) -> Trapezoid:
        axis = self._axis
        return Trapezoid(distance_deg, axis.speed_deg_per_s, axis.acceleration_deg_per_s2)

    def _now_deg(self) -> float:
        return self._position_deg + self._move.travelled_deg(self._clock.now_s() - self._started_s)

    def _write_scene(self) -> None:
        self._scene.set_axis(self._name, self._axis.from_device_deg(self._position_deg))
