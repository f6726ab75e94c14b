"""Axis of the rig: a stage with the rig file's zero, sign, limits and tolerance applied."""

from __future__ import annotations

from instrument.clock import Clock
from instrument.config.axes import HandAxis, MotorAxis
from instrument.devices import Stage
from instrument.errors import DeviceError


class Axis:
    """Moves a stage in the rig's degrees and enforces the limits of the rig file."""

    def __init__(
        self, name: str, stage: Stage, settings: HandAxis | MotorAxis, clock: Clock
    ) -> None:
        self.name, self._stage, self._settings, self._clock = name, stage, settings, clock
        self._target_deg = float("nan")

    @property
    def by_hand(self) -> bool:
        """True if the operator sets this axis."""
        return isinstance(self._settings, HandAxis)

    def identity(self) -> str:
        """Return maker, model and serial number of the stage."""
        return self._stage.identity()

    def home(self) -> None:
        """Find the reference."""
        self._stage.home()

    def homed(self) -> bool:
        """Return True if the stage, at rest, still has its reference."""
        return self._stage.homed()

    def settings(self) -> dict[str, str]:
        """Return the stage's settings, with the rig file's zero and sign."""
        own = self._settings
        if isinstance(own, HandAxis):
            return self._stage.settings()
        return {"zero_deg": f"{own.zero_deg:g}", "sign": str(own.sign), **self._stage.settings()}

    def position_deg(self) -> float:
        """Return the current angle."""
        return self._settings.from_device_deg(self._stage.position_deg())

    def start_move(self, angle_deg: float) -> None:
        """Start a move; raise `DeviceError`, with nothing sent, outside the rig file's limits."""
        low, high = self._settings.min_deg, self._settings.max_deg
        if not low - 1e-9 <= angle_deg <= high + 1e-9:
            raise DeviceError(
                f"{self.name}: {angle_deg:g} deg is outside the rig's limits, {low:g} to "
                f"{high:g} deg: nothing has moved"
            )
        self._target_deg = angle_deg
        self._stage.start_move(self._settings.to_device_deg(angle_deg))

    def set_speed(self, speed_deg_per_s: float) -> None:
        """Let later moves turn at this speed."""
        self._stage.set_speed(speed_deg_per_s)

    def restore_speed(self) -> None:
        """Let later moves of a motor turn at the rig file's speed."""
        if not isinstance(self._settings, HandAxis):
            self._stage.set_speed(self._settings.speed_deg_per_s)

    def finish_move(self) -> None:
        """Wait for the end of the move; raise `DeviceError` if the axis missed its target."""
        reached = self._settings.from_device_deg(self._stage.wait())
        self._require(
            reached, self._target_deg, "", "look for what blocks the stage, then resume the scan"
        )

    def require_at(self, angle_deg: float) -> None:
        """Raise `DeviceError` if the axis has left an angle while frames were taken."""
        after = "after the frames were taken, which do not count, "
        self._require(self.position_deg(), angle_deg, after, "look for what has moved the stage")

    def _require(self, at_deg: float, angle_deg: float, when: str, what_to_do: str) -> None:
        tolerance = self._settings.tolerance_deg
        if abs(at_deg - angle_deg) > tolerance:
            raise DeviceError(
                f"{self.name}: {when}stands at {at_deg:g} deg instead of {angle_deg:g} deg "
                f"(allowed: {tolerance:g} deg off): {what_to_do}"
            )

    def settle(self) -> None:
        """Wait for the settling time of a motor."""
        if not isinstance(self._settings, HandAxis):
            self._clock.sleep(self._settings.settle_s)

    def begin_stop(self) -> None:
        """Send a stop now, without waiting for its effect; from any thread."""
        self._stage.begin_stop()

    def finish_stop(self) -> None:
        """Return once the axis was read to stand; raise `DeviceError` if that is not confirmed."""
        self._stage.finish_stop()

    def stop(self) -> None:
        """Stop all motion, and return once the axis was read to stand."""
        self._stage.stop()

    def close(self) -> None:
        """Release the device."""
        self._stage.close()
