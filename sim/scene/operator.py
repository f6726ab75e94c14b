"""The scene in the operator's place, and its lamp."""

from __future__ import annotations

from instrument.clock import Clock
from instrument.devices import Request
from sim.scene.scene import Scene


class SimulatedOperator:
    """Does at once, in simulated time, what the operator is asked to do."""

    def __init__(self, scene: Scene, clock: Clock) -> None:
        self._scene, self._clock = scene, clock

    def ask(self, request: Request) -> str:
        """Act on the scene and answer as an operator would."""
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
    """A shutter before the simulated lamp."""

    def __init__(self, scene: Scene, clock: Clock) -> None:
        self._scene, self._clock = scene, clock

    def identity(self) -> str:
        """What this lamp is."""
        return "simulated lamp with a shutter"

    def darken(self) -> None:
        """Close the shutter."""
        self._clock.sleep(self._scene.rig.lamp.shutter_s)
        self._scene.lit = False

    def light(self) -> None:
        """Open the shutter."""
        self._clock.sleep(self._scene.rig.lamp.shutter_s)
        self._scene.lit = True
