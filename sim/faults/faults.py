"""Faults planned in words for a simulated scan, to try out the program's response.

    GONIO_FAULTS="theta_r stalls at theta_r.wait 5" gonio run PROTOCOL

plans one fault for this process; `;` separates several. Each names a device, its fault, and the
moment: at or after the n-th call of a device's method. `gonio resume` without the variable
continues with sound devices.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from typing import Any, TypeVar

from instrument.config.axes import AXES, SimulatedAxis
from instrument.devices import Camera, Lamp, Operator, Stage
from instrument.errors import InputError
from sim.faults.faulty_devices import (
    FaultyCamera,
    FaultyDevice,
    FaultyLamp,
    FaultyOperator,
    FaultyStage,
)
from sim.faults.triggers import Triggers, When
from sim.scene.scene import Scene

VARIABLE = "GONIO_FAULTS"
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

    `triggers` counts the devices' calls; `scene` is set once the first stage has been wrapped.
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
        if found is None or found[2] not in FAULTS.get(found[1], ()):
            allowed = "; ".join(f"{name}: {', '.join(words)}" for name, words in FAULTS.items())
            raise InputError(
                f"{VARIABLE}: {text!r}; allowed: DEVICE FAULT at|after DEVICE.CALL NUMBER, as in "
                f"'theta_r stalls at theta_r.wait 5', with {allowed}"
            )
        when: When = "at" if found[3] == "at" else "after"
        self.plan(found[1], found[2], when, found[4], int(found[5]))
