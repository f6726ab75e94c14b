"""Devices of a rig file: the only module of `acquisition` that chooses real or simulated ones.

What to use when: `open_devices` for a scan; `OpenRig` where single devices are needed, as for
setting a rig up.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from acquisition.engine.axis import Axis
from acquisition.engine.engine import Devices
from acquisition.terminal.orderly_end import orderly_end
from drivers.manual import HandCoveredLamp, HandSetAxis
from instrument.board import Board
from instrument.clock import Clock, SystemClock
from instrument.closeable import Closeable
from instrument.config.axes import AXES, HandAxis, OphydAxis, SimulatedAxis, Wired
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
    from drivers.factory import Lines
    from sim.emulated.bench import EmulatedBench

_AXIS_TEXT = {  # in the operator's prompts
    "theta_i": "the lamp's angle of incidence",
    "dphi": "the lamp's azimuth from the camera's plane",
    "theta_r": "the camera's view angle",
}


def check_ready(loaded: Loaded) -> None:
    """Raise `InputError` if a scan cannot begin; call it before one.

    A real rig needs an operator at a terminal, and a calibration must be that of its camera. The
    program restarts here where the rig's camera is emulated.
    """
    if loaded.rig.real:
        from acquisition.terminal.operator import require_terminal

        require_terminal(str(loaded.protocol_path))
    restart_for_emulated_camera(loaded.rig)
    if loaded.rig.camera.measured is not None or loaded.rig.measured is not None:
        with orderly_end(), OpenRig(loaded.rig, faults=Faults()) as rig:
            require_own_calibration(loaded.rig, loaded.rig_path, rig.camera())


def require_own_calibration(rig: Rig, path: Path, camera: Camera) -> None:
    """Raise `InputError` if a calibration that a rig file names is that of another camera."""
    measured, geometry = rig.camera.measured, rig.measured
    if measured is not None:
        name = f"{path}: camera: calibration: {rig.camera.calibration}"
        measured.require_camera(name, camera.identity(), camera.settings())
    if geometry is not None:
        geometry.require_camera(f"{path}: geometry: {rig.geometry}", camera.identity())


def require_dated(loaded: Loaded) -> None:
    """Raise `InputError` if a calibration of the rig is outdated; call it before a new scan.

    A resumed scan goes on with the calibrations that it began with.
    """
    require_calibration_date(loaded.rig, loaded.rig_path)


def require_calibration_date(rig: Rig, path: Path) -> None:
    """Raise `InputError` if a calibration that a rig file names is outdated."""
    measured, geometry, now = rig.camera.measured, rig.measured, datetime.now(UTC)
    if measured is not None:
        measured.require_date(f"{path}: camera: calibration: {rig.camera.calibration}", now)
    if geometry is not None:
        geometry.require_date(f"{path}: geometry: {rig.geometry}", now)


def restart_for_emulated_camera(rig: Rig) -> None:
    """Restart the program, once, if the rig's camera is emulated: see `sim.emulated.bench`."""
    if rig.emulated:
        from sim.emulated.bench import restart_with_camera

        with orderly_end():
            restart_with_camera()


def open_devices(loaded: Loaded, faults: Faults | None = None) -> Devices:
    """Open every device of the rig file; close them all again if one cannot be opened.

    `faults` of a simulated rig, or those in the environment: see `sim.faults.faults`.
    """
    return open_all(loaded.rig, None if loaded.rig.real else _scene(loaded), faults)


def open_all(rig: Rig, scene: Scene | None = None, faults: Faults | None = None) -> Devices:
    """Open every device of a rig; without a scene, a simulated one shows a white sample."""
    with ExitStack() as opening:
        opened = opening.enter_context(OpenRig(rig, scene, faults))
        axes = {name: opened.axis(name) for name in AXES}
        camera = opened.camera()
        devices = Devices(
            axes, camera, opened.lamp, opened.operator, opened.clock, opened.begin_step
        )
        return replace(devices, close=opening.pop_all().close)


def _scene(loaded: Loaded) -> Scene:
    if loaded.protocol.simulated_sample is None:
        raise InputError(
            f"{loaded.protocol_path}: simulated_sample: missing, but the rig {loaded.rig_path} is "
            "simulated: describe the sample"
        )
    return Scene.of(loaded.rig.typed, loaded.protocol)


class OpenRig(Closeable):
    """Devices of a rig, each opened on request and closed at the end of a `with` block.

    `scene` is what a simulated or emulated rig shows; without one, a white sample, a square with
    sides of `white_mm`. `board`: that which its operator may lay there. What is simulated is as the
    rig file's own numbers say; a calibration of the geometry only tells how it is used.
    """

    def __init__(
        self,
        rig: Rig,
        scene: Scene | None = None,
        faults: Faults | None = None,
        white_mm: float = 50.0,
        board: Board | None = None,
    ) -> None:
        self._rig, self._closing = rig, ExitStack()
        self._faults = (faults or Faults.from_environment()) if rig.simulated else None
        self._scene = None if rig.real else scene or Scene.of_white_sample(rig.typed, white_mm)
        self.clock: Clock = SimulatedClock() if rig.simulated else SystemClock()
        if self._scene is not None:
            self._scene.use_clock(self.clock)
            self._scene.board = board or self._scene.board
        if self._faults is not None:
            self._faults.scene = self._scene
        self.operator = self._operator()
        self.lamp = self._lamp()

    def close(self) -> None:
        """Close all devices; may be called twice."""
        self._closing.close()

    def axis(self, name: str) -> Axis:
        """Open one axis."""
        stage = self._stage(name)
        self._closing.callback(stage.close)
        return Axis(name, stage, self._rig.axes[name], self.clock)

    def camera(self) -> Camera:
        """Open the camera."""
        settings = self._rig.camera
        if isinstance(settings, V4l2CameraConfig):
            from drivers.factory import open_camera

            emulated = self._emulated
            device = emulated.plug_camera(settings) if emulated else settings.device
            camera: Camera = open_camera(settings, device, self.clock)
        else:
            from sim.scene.camera import SimulatedCamera

            camera = SimulatedCamera(self._simulated(), self.clock)
            camera = self._faults.camera(camera) if self._faults else camera
        self._closing.callback(camera.close)
        return camera

    def begin_step(self, step: int, scan_s: float) -> None:
        """Announce the next step and the scan's own time to a scene; a real rig ignores it."""
        if self._scene is not None:
            self._scene.begin_step(step, scan_s)

    def pose_scene(self, theta_r_deg: float, theta_i_deg: float = 30.0) -> None:
        """Set the axes of a scene so that the camera sees the lit sample; moves nothing real."""
        if self._scene is not None:
            pose = {"theta_i": theta_i_deg, "dphi": 0.0, "theta_r": theta_r_deg}
            for name, angle_deg in pose.items():
                self._scene.set_axis(name, angle_deg)

    def _stage(self, name: str) -> Stage:
        settings = self._rig.typed.axes[name]
        if isinstance(settings, HandAxis):
            return HandSetAxis(name, _AXIS_TEXT[name], self.operator, settings.tolerance_deg)
        if isinstance(settings, SimulatedAxis):
            from sim.scene.stage import SimulatedStage

            scene = self._simulated()
            stage = SimulatedStage(name, settings, scene, self.clock)
            return self._faults.stage(name, stage, settings, scene) if self._faults else stage
        if isinstance(settings, OphydAxis):
            from drivers.factory import open_ophyd

            return open_ophyd(name, settings, self.clock)
        return self._motor_stage(name, settings)

    def _motor_stage(self, name: str, settings: Wired) -> Stage:
        from drivers.factory import open_stage

        port = self._emulated.plug_axis(name, settings) if self._emulated else settings.port
        return open_stage(name, settings, port, self._lines)

    @cached_property
    def _lines(self) -> Lines:
        from drivers.factory import Lines

        return self._closing.enter_context(Lines(self.clock))

    @cached_property
    def _emulated(self) -> EmulatedBench | None:
        if not self._rig.emulated:
            return None
        from sim.emulated.bench import EmulatedBench

        emulated = EmulatedBench(self._simulated(), self.clock)
        self._closing.callback(emulated.close)
        return emulated

    def _operator(self) -> Operator:
        if self._scene is None:
            from acquisition.terminal.operator import TerminalOperator

            return TerminalOperator()
        # An emulated rig runs in real time, but its operator need not take any.
        clock = self.clock if self._rig.simulated else SimulatedClock()
        operator = SimulatedOperator(self._scene, clock)
        return self._faults.operator(operator) if self._faults else operator

    def _lamp(self) -> Lamp:
        if self._scene is None or self._rig.lamp.darkened_by == "hand":
            return HandCoveredLamp(self.operator)
        shutter = SimulatedShutter(self._scene, self.clock)
        return self._faults.lamp(shutter) if self._faults else shutter

    def _simulated(self) -> Scene:
        if self._scene is None:
            raise InputError(f"{self._rig.name}: simulated and real devices do not mix")
        return self._scene
