"""Faults planned in words for a simulated scan, to try out the program's response.

    GONIO_FAULTS="theta_r stalls at theta_r.wait 5" gonio run PROTOCOL

plans one fault for this process; `;` separates several. Each names a device, its fault, and the
moment: at or after the n-th call of a device's method. `gonio resume` without the variable
continues with sound devices.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from typing import TypeVar, cast

from instrument.config.axes import AXES, SimulatedAxis
from instrument.devices import Camera, Lamp, Operator, Stage
from instrument.errors import InputError
from sim.faults.faulty_devices import FaultyCamera, FaultyLamp, FaultyOperator, FaultyStage
from sim.faults.triggers import Action, Triggers, When
from sim.scene.scene import Scene

VARIABLE = "GONIO_FAULTS"
STAGE: Mapping[str, Callable[[FaultyStage], None]] = {
    "does not answer": FaultyStage.fall_silent,
    "stalls": FaultyStage.stall,
    "stops short": FaultyStage.stop_short,
    "slips": FaultyStage.slip,
    "loses its reference": FaultyStage.lose_reference,
    "meets its limit switch": FaultyStage.meet_switch,
}
CAMERA: Mapping[str, Callable[[FaultyCamera], None]] = {
    "gives no frame": FaultyCamera.freeze,
    "gives a torn frame": FaultyCamera.tear,
    "gives torn frames": FaultyCamera.tear_all,
    "is unplugged": FaultyCamera.unplug,
    "comes back": FaultyCamera.replug,
}
LAMP: Mapping[str, Callable[[FaultyLamp], None]] = {"sticks": FaultyLamp.stick}
OPERATOR: Mapping[str, Callable[[FaultyOperator], None]] = {
    "refuses": FaultyOperator.refuse,
    "leaves": FaultyOperator.leave,
}
_BY_DEVICE: Mapping[str, Mapping[str, object]] = {
    **dict.fromkeys(AXES, STAGE), "camera": CAMERA, "lamp": LAMP, "operator": OPERATOR,
}  # fmt: skip
_FAULT = re.compile(r"(\w+) (.+) (at|after) (\w+\.\w+) ([1-9]\d*)")

D = TypeVar("D")


class Faults:
    """Planned faults of one set of devices; wraps each device so that it can fail.

    `triggers` counts the devices' calls; `scene` is set once the first stage has been wrapped.
    """

    def __init__(self, text: str = "") -> None:
        self.triggers = Triggers()
        self.scene: Scene | None = None
        self._devices: dict[str, object] = {}
        for part in filter(None, map(str.strip, text.split(";"))):
            self._plan_text(part)

    @classmethod
    def from_environment(cls) -> Faults | None:
        """Return the faults in `GONIO_FAULTS`, None if it is empty; raise `InputError` if wrong."""
        text = os.environ.get(VARIABLE, "").strip()
        return cls(text) if text else None

    def plan(self, device: str, fault: str, when: When, call: str, number: int) -> None:
        """Plan a fault from the tables above for a device, at or after a call."""
        self.triggers.plan(when, call, number, self._action(device, fault))

    def stage(self, name: str, stage: Stage, axis: SimulatedAxis, scene: Scene) -> Stage:
        """Wrap the stage of axis `name`."""
        self.scene = scene
        return self._register(name, FaultyStage(name, stage, axis, scene, self.triggers))

    def camera(self, camera: Camera) -> Camera:
        """Wrap the camera."""
        return self._register("camera", FaultyCamera(camera, self.triggers))

    def lamp(self, lamp: Lamp) -> Lamp:
        """Wrap the lamp's shutter."""
        return self._register("lamp", FaultyLamp(lamp, self.triggers))

    def operator(self, operator: Operator) -> Operator:
        """Wrap the operator."""
        return self._register("operator", FaultyOperator(operator, self.triggers))

    def _register(self, name: str, device: D) -> D:
        self._devices[name] = device
        return device

    def _action(self, device: str, fault: str) -> Action:
        make_fail = cast("Callable[[object], None]", _BY_DEVICE[device][fault])

        def action() -> None:
            if device in self._devices:
                make_fail(self._devices[device])

        return action

    def _plan_text(self, text: str) -> None:
        found = _FAULT.fullmatch(text)
        faults = _BY_DEVICE.get(found[1], {}) if found else {}
        if found is None or found[2] not in faults:
            allowed = "; ".join(f"{name}: {', '.join(words)}" for name, words in _BY_DEVICE.items())
            raise InputError(
                f"{VARIABLE}: {text!r}; allowed: DEVICE FAULT at|after DEVICE.CALL NUMBER, as in "
                f"'theta_r stalls at theta_r.wait 5', with {allowed}"
            )
        when: When = "at" if found[3] == "at" else "after"
        self.plan(found[1], found[2], when, found[4], int(found[5]))
