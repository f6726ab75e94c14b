"""The one place that chooses real or simulated devices: a rig file in, open devices out."""

from __future__ import annotations

from acquisition.axis import Axis
from acquisition.engine import Devices
from drivers.hand_set import HandCoveredLamp, HandSetAxis
from instrument.axis_config import AXES, HandAxis
from instrument.clock import Clock
from instrument.config import Loaded
from instrument.devices import Lamp, Operator, Stage
from instrument.errors import InputError
from sim.camera import SimulatedCamera
from sim.clock import SimulatedClock
from sim.operator import SimulatedOperator, SimulatedShutter
from sim.scene import Scene
from sim.stage import SimulatedStage

WORDS = {
    "theta_i": "the lamp's angle of incidence",
    "dphi": "the lamp's azimuth from the camera's plane",
    "theta_r": "the camera's view angle",
}


def open_devices(loaded: Loaded, elapsed_s: float = 0.0) -> Devices:
    """Open every device of the rig file. The simulated scene answers the operator's prompts.

    `elapsed_s` is the time that the scan has taken already: the simulated lamp has aged by it.
    """
    sample = loaded.protocol.simulated_sample
    if sample is None:
        raise InputError(
            f"{loaded.protocol_path}: simulated_sample: missing, but the rig {loaded.rig_path} is "
            "simulated: say what the sample is"
        )
    clock = SimulatedClock(elapsed_s)
    scene = Scene(loaded.rig, loaded.protocol, sample)
    operator = SimulatedOperator(scene, clock)

    def begin_step(step: int) -> None:
        scene.step = step

    return Devices(
        {name: _axis(name, scene, operator, clock) for name in AXES},
        SimulatedCamera(scene, clock),
        _lamp(scene, operator, clock),
        operator,
        clock,
        begin_step,
    )


def _axis(name: str, scene: Scene, operator: Operator, clock: Clock) -> Axis:
    settings = scene.rig.axes[name]
    stage: Stage
    if isinstance(settings, HandAxis):
        stage = HandSetAxis(name, WORDS[name], operator)
    else:
        stage = SimulatedStage(name, settings, scene, clock)
    return Axis(name, stage, settings, clock)


def _lamp(scene: Scene, operator: Operator, clock: Clock) -> Lamp:
    if scene.rig.lamp.darkened_by == "hand":
        return HandCoveredLamp(operator)
    return SimulatedShutter(scene, clock)
