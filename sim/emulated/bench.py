"""Emulated optical table: controllers and camera that the real drivers open, over one scene.

The controllers answer in bytes on pseudo-terminals and the camera answers V4L2 requests, all in
real time.
"""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
import threading
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import assert_never

from drivers.v4l2.ioctl import FULL_RANGE, LIMITED_RANGE
from instrument.clock import Clock
from instrument.config.axes import NewportAxis, OrientalAxis, Wired, ZaberAxis
from instrument.config.camera import CameraDefects, V4l2CameraConfig
from instrument.devices import Image
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.newport_controller import NewportController
from sim.emulated.oriental_controller import OrientalController
from sim.emulated.v4l2.device import Capabilities, EmulatedCamera, Exposure
from sim.emulated.v4l2.server import V4l2Server
from sim.emulated.v4l2.shim import compile_shim, shim_environment
from sim.emulated.wire import Controller, PtyWire
from sim.emulated.zaber_controller import ZaberController
from sim.scene.scene import Scene
from sim.scene.sensor import in_one, sensors_of

CAMERA_DEVICE = "/dev/v4l/by-id/emulated-gonio-camera"
_SOCKET = "GONIO_V4L2_SOCKET"
_FOLDER = "GONIO_V4L2_FOLDER"  # temporary folder, removed when the program ends
_LIMIT_MARGIN_DEG = 5.0  # of the controllers' own limits beyond those in the rig file
_FRAMES_PER_S = 400


def restart_with_camera() -> None:
    """Restart the program with the emulated camera's library preloaded, unless it already is.

    The dynamic loader reads LD_PRELOAD only when a process starts.
    """
    if _SOCKET in os.environ:
        if _FOLDER in os.environ:
            atexit.register(shutil.rmtree, os.environ[_FOLDER], ignore_errors=True)
        return
    folder = Path(tempfile.mkdtemp(prefix="gonio-"))
    try:
        library = compile_shim(folder)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    added = shim_environment(library, CAMERA_DEVICE, folder / "camera")
    added[_FOLDER] = str(folder)
    os.execve(
        sys.executable,
        [sys.executable, "-m", "acquisition", *sys.argv[1:]],
        {**os.environ, **added},
    )


class EmulatedBench:
    """Emulated devices over one scene; each is connected just before its driver opens it."""

    def __init__(self, scene: Scene, clock: Clock) -> None:
        self._scene, self._clock = scene, clock
        self.motors: dict[str, Motor] = {}
        self._shown_deg: dict[str, float] = {}
        self._closing = ExitStack()

    def close(self) -> None:
        """Disconnect all devices."""
        self._closing.close()

    def plug_axis(self, name: str, axis: Wired) -> str:
        """Connect the controller of an axis to a port of its own; return the port."""
        return self._closing.enter_context(PtyWire([self.controller(name, axis)])).port

    def controller(self, name: str, axis: Wired) -> Controller:
        """Return the controller of an axis, with its motor; the scene follows the motor."""
        low, high = axis.device_limits_deg()
        mechanics = Mechanics(
            min_deg=low - _LIMIT_MARGIN_DEG,
            max_deg=high + _LIMIT_MARGIN_DEG,
            speed_deg_per_s=axis.speed_deg_per_s,
            acceleration_deg_per_s2=axis.acceleration_deg_per_s2,
            home_deg=axis.to_device_deg(axis.home_deg),
            homing_s=axis.homing_s / 2,
        )
        motor = self.motors[name] = Motor(mechanics, self._clock)
        return _controller(axis, motor)

    def plug_camera(self, camera: V4l2CameraConfig) -> str:
        """Connect the camera; return the device path for its driver."""
        device = self.camera(camera)
        self._closing.enter_context(V4l2Server(device, Path(os.environ[_SOCKET])))
        return CAMERA_DEVICE

    def camera(self, camera: V4l2CameraConfig) -> EmulatedCamera:
        """Return the camera, which takes pictures of the scene."""
        self._scene.mottling()  # computed once, shared by all snapshots
        sensors, lock = sensors_of(self._scene), threading.Lock()

        def render(exposure: Exposure, snapshot: object) -> Image:
            with lock:
                exposure_s, poses = exposure.exposure_s, tuple[dict[str, float], ...]()
                if isinstance(snapshot, Scene):
                    poses = snapshot.poses_during(exposure.start_s, exposure_s)
                    for sensor in sensors:
                        sensor.scene = snapshot
                return in_one([sensor.picture(exposure_s, poses) for sensor in sensors])

        capabilities = _capabilities(camera, self._scene.rig.simulation.camera_defects)
        return EmulatedCamera(render, self._snapshot, capabilities)

    def _snapshot(self) -> Scene:
        """Copy of the scene at the start of an exposure, with the motors' angles and motions."""
        scene, motions = self._scene, dict[str, Callable[[float], float]]()
        for name, motor in self.motors.items():
            axis, angle_deg = scene.rig.axes[name], motor.position_deg
            if self._shown_deg.get(name) != angle_deg:
                scene.set_axis(name, axis.from_device_deg(angle_deg))
                self._shown_deg[name] = angle_deg
            if (motion := motor.motion()) is not None:
                motions[name] = partial(_rig_angle_deg, axis.from_device_deg, motion)
        return replace(scene, true_deg=dict(scene.true_deg), motions=motions)


def _rig_angle_deg(
    from_device_deg: Callable[[float], float], motion: Callable[[float], float], time_s: float
) -> float:
    return from_device_deg(motion(time_s))


def _controller(axis: Wired, motor: Motor) -> Controller:
    match axis:
        case NewportAxis():
            return NewportController(motor, axis.address, axis.model)
        case ZaberAxis():
            return ZaberController(motor, axis.device, axis.microsteps_per_deg)
        case OrientalAxis():
            return OrientalController(motor, axis.unit, axis.steps_per_deg)
        case _:
            assert_never(axis)


def _capabilities(camera: V4l2CameraConfig, defects: CameraDefects) -> Capabilities:
    frames_per_s = camera.frames_per_s or _FRAMES_PER_S
    limited = camera.luma_range == "limited"
    if limited:  # the rig file's sensor has these counts already
        defects = defects.model_copy(update={"limited_range": "none"})
    return Capabilities(
        defects=defects,
        quantization=LIMITED_RANGE if limited else FULL_RANGE,
        formats=(camera.pixel_format,),
        sizes=((camera.width_px, camera.height_px),),
        frames_per_s=frames_per_s,
        overhead_s=min(camera.frame_overhead_s, 1 / frames_per_s),
    )
