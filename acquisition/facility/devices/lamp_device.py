"""Lamp of a rig as bluesky sets it: "light" or "dark", and dark whenever it is stopped."""

from __future__ import annotations

from acquisition.engine.onlookers import KnownLamp
from acquisition.facility.devices.actions import ActionStatus, ActionThread
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
from instrument.config.rig import Rig
from instrument.errors import InputError

LIGHT, DARK = "light", "dark"
_WORDS = {"lit": LIGHT, "darkened": DARK, "unknown": "unknown"}


class LampDevice:
    """Lamp with its shutter. A run engine stops what it has set at every end and at every pause.

    After a pause the lamp is as before. A lamp without a shutter is covered by the operator, who is
    asked for that only where a plan sets it.
    """

    parent = None

    def __init__(self, rig: Rig, lamp: KnownLamp, thread: ActionThread, clock: Clock) -> None:
        self.name = "lamp"
        self._lamp, self._thread, self._clock = lamp, thread, clock
        self._has_shutter = rig.lamp.darkened_by == "shutter"
        self._lit_before = False
        self._asked = DARK

    @property
    def hints(self) -> dict[str, list[str]]:
        """Field to show."""
        return {"fields": [self.name]}

    def set(self, value: str) -> ActionStatus:
        """Begin to light or to darken the sample: "light" or "dark"."""
        self.check_value(value)
        self._asked = value
        return self._thread.begin(self._lamp.light if value == LIGHT else self._lamp.darken)

    def check_value(self, value: str) -> None:
        """Raise `InputError` for anything but "light" and "dark"."""
        if value not in (LIGHT, DARK):
            raise InputError(f"lamp: {value!r}; allowed: {LIGHT!r} or {DARK!r}")

    def stop(self, success: bool = True) -> None:
        """Close the shutter after what was asked for before; after a success it may be lit anew."""
        self._lit_before = success and (self._lit_before or self._asked == LIGHT)
        if self._has_shutter and not self._thread.closed:
            self._asked = DARK
            self._thread.begin(self._lamp.darken)

    def pause(self) -> None:
        """Do nothing more: the lamp is stopped before."""

    def resume(self) -> None:
        """Light the lamp again, if it was lit when it was stopped for a pause."""
        if self._lit_before and self._has_shutter:
            self.set(LIGHT).wait()
        self._lit_before = False

    def locate(self) -> dict[str, str]:
        """Return what was asked for last, and the state of the lamp."""
        return {"setpoint": self._asked, "readback": _WORDS[self._lamp.state]}

    def read(self) -> dict[str, ReadingDict]:
        """Return "light", "dark", or "unknown" before it was set."""
        return {self.name: reading(_WORDS[self._lamp.state], self._clock.utc().timestamp())}

    def describe(self) -> dict[str, KeyDict]:
        """Return the description of what `read` returns."""
        return {self.name: data_key(self.name, str, f"gonio:{self.name}")}

    def read_configuration(self) -> dict[str, ReadingDict]:
        """Return what darkens the lamp."""
        return readings(self._configuration(), self._clock.utc().timestamp())

    def describe_configuration(self) -> dict[str, KeyDict]:
        """Return the description of what `read_configuration` returns."""
        return data_keys(self._configuration(), f"gonio:{self.name}")

    def _configuration(self) -> dict[str, Value]:
        return {f"{self.name}_identity": self._lamp.identity()}
