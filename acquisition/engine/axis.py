"""One axis of the rig: a stage behind the rig file's zero, sign and limits."""

from __future__ import annotations

from instrument.clock import Clock
from instrument.config.axes import HandAxis, MotorAxis
from instrument.devices import Stage
from instrument.errors import DeviceError


class Axis:
    """Moves a stage in the rig's degrees; refuses what the rig file does not allow."""

    def __init__(
        self, name: str, stage: Stage, settings: HandAxis | MotorAxis, clock: Clock
    ) -> None:
        self.name, self._stage, self._settings, self._clock = name, stage, settings, clock
        self._target_deg = float("nan")

    @property
    def by_hand(self) -> bool:
        """Whether the operator moves this axis."""
        return isinstance(self._settings, HandAxis)

    def identity(self) -> str:
        """Who answers."""
        return self._stage.identity()

    def home(self) -> None:
        """Find the reference."""
        self._stage.home()

    def homed(self) -> bool:
        """Whether it still knows its reference, asked once it has come to rest."""
        return self._stage.homed()

    def settings(self) -> dict[str, str]:
        """What the stage says that it is set to, with the rig file's zero and sign."""
        own = self._settings
        if isinstance(own, HandAxis):
            return self._stage.settings()
        return {"zero_deg": f"{own.zero_deg:g}", "sign": str(own.sign), **self._stage.settings()}

    def position_deg(self) -> float:
        """Where the axis is."""
        return self._settings.from_device_deg(self._stage.position_deg())

    def start_move(self, angle_deg: float) -> None:
        """Begin to move; past a limit of the rig file nothing is sent to the device."""
        low, high = self._settings.min_deg, self._settings.max_deg
        if not low - 1e-9 <= angle_deg <= high + 1e-9:
            raise DeviceError(
                f"{self.name}: {angle_deg:g} deg is outside the rig's limits, {low:g} to "
                f"{high:g} deg: nothing has moved"
            )
        self._target_deg = angle_deg
        self._stage.start_move(self._settings.to_device_deg(angle_deg))

    def finish_move(self) -> None:
        """Wait for the end of the move and check where the axis stands."""
        reached = self._settings.from_device_deg(self._stage.wait())
        self._require(reached, self._target_deg, "", "look for what holds the stage, then go on")

    def require_at(self, angle_deg: float) -> None:
        """Raise `DeviceError` where the axis, once at rest there, no longer stands at an angle."""
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
        """Let the axis come to rest."""
        if not isinstance(self._settings, HandAxis):
            self._clock.sleep(self._settings.settle_s)

    def stop(self) -> None:
        """End all motion now."""
        self._stage.stop()

    def close(self) -> None:
        """Let go of the device."""
        self._stage.close()
