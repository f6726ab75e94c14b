"""Faults of a simulated bench, planned in words: to try what a scan does when something fails.

    GONIO_FAULTS="theta_r stalls at theta_r.wait 5" gonio run PROTOCOL

plans one fault for this process (more are parted by `;`): a device, what happens to it, and the
moment: at or after the how-manieth call of a device. `gonio resume` without it goes on with a sound
bench.
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
from sim.faults.triggers import Action, Moments, When
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
_KNOWN: Mapping[str, Mapping[str, object]] = {
    **dict.fromkeys(AXES, STAGE), "camera": CAMERA, "lamp": LAMP, "operator": OPERATOR,
}  # fmt: skip
_FAULT = re.compile(r"(\w+) (.+) (at|after) (\w+\.\w+) ([1-9]\d*)")


D = TypeVar("D")


class Faults:
    """What is to go wrong on one bench. `moments` counts its calls; `scene` is known once open."""

    def __init__(self, text: str = "") -> None:
        self.moments = Moments()
        self.scene: Scene | None = None
        self._devices: dict[str, object] = {}
        for one in filter(None, (part.strip() for part in text.split(";"))):
            self._plan_text(one)

    @classmethod
    def asked_for(cls) -> Faults | None:
        """Those of the environment, or None; `InputError` says what may be asked for."""
        text = os.environ.get(VARIABLE, "").strip()
        return cls(text) if text else None

    def plan(self, device: str, fault: str, when: When, call: str, number: int) -> None:
        """Let a fault of one of the tables above happen to a device, at that call."""
        self.moments.plan(when, call, number, self._happening(device, fault))

    def stage(self, name: str, stage: Stage, axis: SimulatedAxis, scene: Scene) -> Stage:
        """A motor axis that can fail."""
        self.scene = scene
        return self._known(name, FaultyStage(name, stage, axis, scene, self.moments))

    def camera(self, camera: Camera) -> Camera:
        """A camera that can fail."""
        return self._known("camera", FaultyCamera(camera, self.moments))

    def lamp(self, lamp: Lamp) -> Lamp:
        """A shutter that can fail."""
        return self._known("lamp", FaultyLamp(lamp, self.moments))

    def operator(self, operator: Operator) -> Operator:
        """An operator who may refuse."""
        return self._known("operator", FaultyOperator(operator, self.moments))

    def _known(self, name: str, device: D) -> D:
        self._devices[name] = device
        return device

    def _happening(self, device: str, fault: str) -> Action:
        happen = cast("Callable[[object], None]", _KNOWN[device][fault])

        def action() -> None:
            if device in self._devices:
                happen(self._devices[device])

        return action

    def _plan_text(self, text: str) -> None:
        found = _FAULT.fullmatch(text)
        known = _KNOWN.get(found[1], {}) if found else {}
        if found is None or found[2] not in known:
            allowed = "; ".join(f"{name}: {', '.join(words)}" for name, words in _KNOWN.items())
            raise InputError(
                f"{VARIABLE}: {text!r}; allowed: DEVICE FAULT at|after DEVICE.CALL NUMBER, as in "
                f"'theta_r stalls at theta_r.wait 5', with {allowed}"
            )
        when: When = "at" if found[3] == "at" else "after"
        self.plan(found[1], found[2], when, found[4], int(found[5]))
