"""Faults of a simulated rig's lamp that no device reports."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest

from acquisition.engine.engine import Devices
from sim.scene.scene import Scene
from tests.support.stand_ins import PassThrough


class LeakyLamp(PassThrough):
    """Lamp whose shutter or lid lets a share of the light through; `times`: that it is not shut."""

    leak, times = 1.0, 0

    def __init__(self, device: object, fault: LampFault) -> None:
        super().__init__(device)
        self._fault = fault

    def darken(self) -> None:
        """Let some light through, or darken as it should be."""
        if self._fault.times_open > 0:
            self._fault.times_open -= 1
            self._fault.level = self._fault.leak
        else:
            self._device.darken()  # type: ignore[attr-defined]  # a lamp

    def light(self) -> None:
        """Uncover the lamp."""
        self._fault.level = 1.0
        self._device.light()  # type: ignore[attr-defined]  # a lamp


@dataclass
class LampFault:
    """Fault of the simulated lamp: `level` times its light, by itself or by `at_step`.

    leak: share of the light that passes while the lamp should be dark, `times_open` times.
    at_step: level from a step of the plan on.
    """

    level: float = 1.0
    leak: float = 1.0
    times_open: int = 0
    at_step: dict[int, float] | None = None

    def install(self, monkeypatch: pytest.MonkeyPatch) -> LampFault:
        """Let every simulated scene have this fault."""
        real = Scene.lamp_level

        def level(scene: Scene) -> float:
            changes = self.at_step or {}
            begun = [step for step in changes if step <= scene.step]
            return real(scene) * self.level * (changes[max(begun)] if begun else 1.0)

        monkeypatch.setattr(Scene, "lamp_level", level)
        return self

    def devices(self, devices: Devices) -> Devices:
        """Return the devices with a lamp that leaks."""
        return replace(devices, lamp=LeakyLamp(devices.lamp, self))  # type: ignore[arg-type]  # a stand-in
