"""Simulated operator and lamp shutter: both act on the scene in simulated time."""

from __future__ import annotations

from instrument.clock import Clock
from instrument.devices import Request
from sim.scene.scene import Scene


class SimulatedOperator:
    """Operator who carries out every request and takes the time the rig file gives for it."""

    def __init__(self, scene: Scene, clock: Clock) -> None:
        self._scene, self._clock = scene, clock

    def ask(self, request: Request) -> str:
        """Change the scene as requested and return the operator's answer."""
        rig = self._scene.rig
        if request.action == "set axis":
            axis = rig.axes[request.axis]
            self._clock.sleep(getattr(axis, "set_s", 0.0))
            self._scene.set_axis(request.axis, request.angle_deg)
            return f"{request.angle_deg:g}"
        if request.action == "place":
            self._clock.sleep(rig.swap_s)
            self._scene.surface = request.surface
        else:
            self._clock.sleep(rig.lamp.cover_s)
            self._scene.lit = request.action == "uncover lamp"
        return "done"


class SimulatedShutter:
    """Motorised shutter of the simulated lamp."""

    def __init__(self, scene: Scene, clock: Clock) -> None:
        self._scene, self._clock = scene, clock

    def identity(self) -> str:
        """Return a description of the lamp."""
        return "simulated lamp with a shutter"

    def darken(self) -> None:
        """Close the shutter."""
        self._move(lit=False)

    def light(self) -> None:
        """Open the shutter."""
        self._move(lit=True)

    def _move(self, lit: bool) -> None:
        self._clock.sleep(self._scene.rig.lamp.shutter_s)
        self._scene.lit = lit
