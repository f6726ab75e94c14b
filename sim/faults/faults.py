"""Faults planned in words for a simulated scan, to try out the program's response.

    GONIO_FAULTS="theta_r stalls at theta_r.wait 5" gonio run PROTOCOL

plans one fault for this process; `;` separates several. Each names a device, its fault, and the
moment: at or after the n-th call of a device's method. `gonio resume` without the variable
continues with sound devices.

    GONIO_FAULTS="world lamp 0.95 at camera.grab 30; world lamp 1 at camera.grab 60"

makes the lamp dim for a while, which no device reports: see `sim.defects.world` for the names.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from typing import Any, TypeVar

from instrument.config.axes import AXES, SimulatedAxis
from instrument.devices import Camera, Lamp, Operator, Stage
from instrument.errors import InputError
from sim.defects.world import SOUND
from sim.faults.faulty_devices import (
    FaultyCamera,
    FaultyDevice,
    FaultyLamp,
    FaultyOperator,
    FaultyStage,
)
from sim.faults.triggers import Triggers, When
from sim.scene.scene import Scene

VARIABLE, WORLD = "GONIO_FAULTS", "world"
FAULTS: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(AXES, FaultyStage.faults),
    "camera": FaultyCamera.faults,
    "lamp": FaultyLamp.faults,
    "operator": FaultyOperator.faults,
}
_FAULT = re.compile(r"(\w+) (.+) (at|after) (\w+\.\w+) ([1-9]\d*)")

D = TypeVar("D", bound=FaultyDevice[Any])


class Faults:
    """Planned faults of one set of devices; wraps each device so that it can fail.

    `triggers` counts the devices' calls; `scene` is set when the rig is opened.
    """

    def __init__(self, text: str = "") -> None:
        self.triggers = Triggers()
        self.scene: Scene | None = None
        self._devices: dict[str, FaultyDevice[Any]] = {}
        for part in filter(None, map(str.strip, text.split(";"))):
            self._plan_text(part)

    @classmethod
    def from_environment(cls) -> Faults | None:
        """Return the faults in `GONIO_FAULTS`, None if it is empty; raise `InputError` if wrong."""
        text = os.environ.get(VARIABLE, "").strip()
        return cls(text) if text else None

    def plan(self, device: str, fault: str, when: When, call: str, number: int) -> None:
        """Plan a fault listed in `FAULTS`, at or after a call."""

        def make_fail() -> None:
            if device in self._devices:
                self._devices[device].fail(fault)

        self.triggers.plan(when, call, number, make_fail)

    def plan_world(self, fault: str, value: str, when: When, call: str, number: int) -> None:
        """Plan a fault of `sim.defects.world`, with its size; raise `ValueError` without one."""
        SOUND.changed(fault, value)

        def change() -> None:
            if self.scene is not None:
                self.scene.world = self.scene.world.changed(fault, value)

        self.triggers.plan(when, call, number, change)

    def stage(self, name: str, stage: Stage, axis: SimulatedAxis, scene: Scene) -> Stage:
        """Wrap the stage of axis `name`."""
        self.scene = scene
        return self._register(name, FaultyStage(name, stage, axis, scene, self.triggers))

    def camera(self, camera: Camera) -> Camera:
        """Wrap the camera."""
        return self._register("camera", FaultyCamera("camera", camera, self.triggers))

    def lamp(self, lamp: Lamp) -> Lamp:
        """Wrap the lamp's shutter."""
        return self._register("lamp", FaultyLamp("lamp", lamp, self.triggers))

    def operator(self, operator: Operator) -> Operator:
        """Wrap the operator."""
        return self._register("operator", FaultyOperator("operator", operator, self.triggers))

    def _register(self, name: str, device: D) -> D:
        self._devices[name] = device
        return device

    def _plan_text(self, text: str) -> None:
        found = _FAULT.fullmatch(text)
        if found is not None and found[1] == WORLD:
            self._plan_world_text(text, found)
            return
        if found is None or found[2] not in FAULTS.get(found[1], ()):
            allowed = "; ".join(f"{name}: {', '.join(words)}" for name, words in FAULTS.items())
            raise InputError(
                f"{VARIABLE}: {text!r}; allowed: DEVICE FAULT at|after DEVICE.CALL NUMBER, as in "
                f"'theta_r stalls at theta_r.wait 5', with {allowed}"
            )
        self.plan(found[1], found[2], _when(found), found[4], int(found[5]))

    def _plan_world_text(self, text: str, found: re.Match[str]) -> None:
        fault, _, value = found[2].partition(" ")
        try:
            self.plan_world(fault, value, _when(found), found[4], int(found[5]))
        except ValueError as error:
            raise InputError(f"{VARIABLE}: {text!r}: {error}") from None


def _when(found: re.Match[str]) -> When:
    return "at" if found[3] == "at" else "after"
