"""Axis of a rig as bluesky drives it: Movable, Readable, Locatable, Stoppable, Checkable."""

from __future__ import annotations

import math
from numbers import Real

from acquisition.facility.devices.actions import ActionStatus
from acquisition.facility.devices.motion import Motion
from acquisition.facility.devices.readings import (
    KeyDict,
    ReadingDict,
    Value,
    data_key,
    data_keys,
    reading,
    readings,
)
from instrument.clock import Clock
from instrument.config.axes import HandAxis, MotorAxis
from instrument.errors import InputError


class AxisDevice:
    """One axis, in degrees of the rig. A move that fails or is refused is a failed status.

    Staging makes the whole rig ready: the way of one axis depends on where the others stand.
    """

    parent = None

    def __init__(
        self, name: str, motion: Motion, settings: HandAxis | MotorAxis, clock: Clock
    ) -> None:
        self.name, self._motion, self._settings, self._clock = name, motion, settings, clock
        self._setpoint_deg = math.nan

    @property
    def hints(self) -> dict[str, list[str]]:
        """Field to plot against."""
        return {"fields": [self.name]}

    def stage(self) -> ActionStatus:
        """Make the rig's axes ready; those without a reference are homed, which moves them."""
        return self._motion.begin_ready()

    def unstage(self) -> ActionStatus:
        """Halt the axis."""
        self.stop()
        return self._motion.begin_nothing()

    def set(self, value: float) -> ActionStatus:
        """Begin to move to an angle in degrees."""
        angle_deg = self._number(value)
        self._setpoint_deg = angle_deg
        return self._motion.begin_move(**{self.name: angle_deg})

    def stop(self, success: bool = True) -> None:
        """Stop the axis now, from any thread; `success`: the move that ends is no failure."""
        self._motion.halt(self.name, expected=success)

    def check_value(self, value: float) -> None:
        """Raise `InputError` for an angle in degrees outside the limits of the rig file."""
        self._motion.require_within(self.name, self._number(value))

    def locate(self) -> dict[str, float]:
        """Return where the axis was told to go and where it is, in degrees."""
        at_deg = self._motion.axes[self.name].position_deg()
        asked_deg = at_deg if math.isnan(self._setpoint_deg) else self._setpoint_deg
        return {"setpoint": asked_deg, "readback": at_deg}

    def read(self) -> dict[str, ReadingDict]:
        """Return the angle in degrees."""
        at_deg = self._motion.axes[self.name].position_deg()
        return {self.name: reading(at_deg, self._clock.utc().timestamp())}

    def describe(self) -> dict[str, KeyDict]:
        """Return the unit of what `read` returns."""
        return {self.name: data_key(self.name, float, f"gonio:{self.name}", "deg")}

    def read_configuration(self) -> dict[str, ReadingDict]:
        """Return what answers, and the limits and the u of the rig file in degrees."""
        return readings(self._configuration(), self._clock.utc().timestamp())

    def describe_configuration(self) -> dict[str, KeyDict]:
        """Return the units of what `read_configuration` returns."""
        return data_keys(self._configuration(), f"gonio:{self.name}")

    def _configuration(self) -> dict[str, Value]:
        own = self._settings
        return {
            f"{self.name}_identity": self._motion.axes[self.name].identity(),
            f"{self.name}_min_deg": float(own.min_deg),
            f"{self.name}_max_deg": float(own.max_deg),
            f"{self.name}_u_deg": float(own.u_deg),
        }

    def _number(self, value: object) -> float:
        number = float(value) if isinstance(value, Real) else math.nan
        if not math.isfinite(number):
            raise InputError(f"{self.name}: {value!r}; allowed: a finite number of degrees")
        return number
