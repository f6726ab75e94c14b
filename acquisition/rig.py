"""The one place that chooses real, emulated or simulated devices, by the rig file."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING

from acquisition.engine.axis import Axis
from acquisition.engine.engine import Devices
from drivers.manual import HandCoveredLamp, HandSetAxis
from instrument.clock import Clock, SystemClock
from instrument.closeable import Closing
from instrument.config.axes import AXES, HandAxis, SimulatedAxis, Wired
from instrument.config.camera import V4l2CameraConfig
from instrument.config.load import Loaded
from instrument.config.rig import Rig
from instrument.devices import Camera, Lamp, Operator, Stage
from instrument.errors import InputError
from sim.clock import SimulatedClock
from sim.faults.faults import Faults
from sim.scene.operator import SimulatedOperator, SimulatedShutter
from sim.scene.scene import Scene

if TYPE_CHECKING:
    from sim.emulated.bench import EmulatedBench

WORDS = {
    "theta_i": "the lamp's angle of incidence",
    "dphi": "the lamp's azimuth from the camera's plane",
    "theta_r": "the camera's view angle",
}


def prepare(loaded: Loaded) -> None:
    """What has to be so before a run's folder is made.

    Raises `InputError` where a real rig has no terminal at which somebody serves it.
    """
    if loaded.rig.real:
        from acquisition.terminal.operator import require_terminal

        require_terminal(str(loaded.protocol_path))
    see_emulated_camera(loaded.rig)


def see_emulated_camera(rig: Rig) -> None:
    """Start the program again, once, where its camera is emulated: see `sim.emulated.bench`."""
    if rig.emulated:
        from sim.emulated.bench import restart_with_camera

        restart_with_camera()


def open_devices(loaded: Loaded, faults: Faults | None = None) -> Devices:
    """Open every device of the rig file, and close them all again if one cannot be opened.

    A scene that is simulated answers the operator's prompts; its devices have the `faults`, or
    those of the environment: see `sim.faults.faults`.
    """
    with ExitStack() as opening:
        bench = opening.enter_context(Bench(loaded, faults))
        axes = {name: bench.axis(name) for name in AXES}
        camera, step = bench.camera(), bench.begin_step
        devices = Devices(axes, camera, bench.lamp, bench.operator, bench.clock, step)
        return replace(devices, close=opening.pop_all().close)


class Bench(Closing):
    """What a rig file describes; each device is opened when it is asked for. Use it with `with`."""

    def __init__(self, loaded: Loaded, faults: Faults | None = None) -> None:
        from drivers.factory import Lines

        self._faults = (faults or Faults.from_environment()) if loaded.rig.simulated else None
        self._rig, self._closing = loaded.rig, ExitStack()
        self._scene = None if self._rig.real else _scene(loaded)
        self.clock: Clock = SimulatedClock() if self._rig.simulated else SystemClock()
        self.operator = self._operator()
        self.lamp = self._lamp()
        self._lines = self._closing.enter_context(Lines(self.clock))
        self._emulated = self._emulate() if self._rig.emulated else None

    def close(self) -> None:
        """Let go of all of it; safe twice."""
        self._closing.close()

    def axis(self, name: str) -> Axis:
        """One axis, open."""
        stage = self._stage(name)
        self._closing.callback(stage.close)
        return Axis(name, stage, self._rig.axes[name], self.clock)

    def camera(self) -> Camera:
        """The camera, open."""
        if isinstance(self._rig.camera, V4l2CameraConfig):
            from drivers.factory import open_camera

            settings = self._rig.camera
            device = self._emulated.plug_camera(settings) if self._emulated else settings.device
            camera: Camera = open_camera(settings, device, self.clock)
        else:
            from sim.scene.camera import SimulatedCamera

            camera = SimulatedCamera(self._simulated(), self.clock)
            camera = self._faults.camera(camera) if self._faults else camera
        self._closing.callback(camera.close)
        return camera

    def begin_step(self, step: int, planned_s: float) -> None:
        """Tell a simulated scene which step comes next, and when; a real bench need not know."""
        if self._scene is not None:
            self._scene.begin_step(step, planned_s)

    def stand_at(self, theta_r_deg: float) -> None:
        """Have a simulated scene stand so that something is to be seen; nothing real moves."""
        if self._scene is not None:
            for name, angle_deg in (("theta_i", 30.0), ("dphi", 0.0), ("theta_r", theta_r_deg)):
                self._scene.set_axis(name, angle_deg)

    def _stage(self, name: str) -> Stage:
        settings = self._rig.axes[name]
        if isinstance(settings, HandAxis):
            return HandSetAxis(name, WORDS[name], self.operator, settings.tolerance_deg)
        if isinstance(settings, SimulatedAxis):
            from sim.scene.stage import SimulatedStage

            scene = self._simulated()
            stage = SimulatedStage(name, settings, scene, self.clock)
            return self._faults.stage(name, stage, settings, scene) if self._faults else stage
        return self._driven(name, settings)

    def _driven(self, name: str, settings: Wired) -> Stage:
        from drivers.factory import open_stage

        port = self._emulated.plug_axis(name, settings) if self._emulated else settings.port
        return open_stage(name, settings, port, self._lines)

    def _operator(self) -> Operator:
        if self._scene is None:
            from acquisition.terminal.operator import TerminalOperator

            return TerminalOperator()
        # In real time too nobody waits for an operator who is simulated.
        clock = self.clock if self._rig.simulated else SimulatedClock()
        operator = SimulatedOperator(self._scene, clock)
        return self._faults.operator(operator) if self._faults else operator

    def _lamp(self) -> Lamp:
        if self._scene is None or self._rig.lamp.darkened_by == "hand":
            return HandCoveredLamp(self.operator)
        shutter = SimulatedShutter(self._scene, self.clock)
        return self._faults.lamp(shutter) if self._faults else shutter

    def _emulate(self) -> EmulatedBench:
        from sim.emulated.bench import EmulatedBench

        emulated = EmulatedBench(self._simulated(), self.clock)
        self._closing.callback(emulated.close)
        return emulated

    def _simulated(self) -> Scene:
        if self._scene is None:
            raise InputError(f"{self._rig.name}: simulated and real devices do not mix")
        return self._scene


def _scene(loaded: Loaded) -> Scene:
    sample = loaded.protocol.simulated_sample
    if sample is None:
        raise InputError(
            f"{loaded.protocol_path}: simulated_sample: missing, but the rig {loaded.rig_path} is "
            "simulated: say what the sample is"
        )
    return Scene(loaded.rig, loaded.protocol, sample)
