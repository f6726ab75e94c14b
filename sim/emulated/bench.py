"""Emulated devices over the simulated scene: what real drivers talk to where there is no bench.

Controllers answer in bytes on pseudo-terminals, the camera answers V4L2's own requests; all of them
look at one scene, in real time.
"""

from __future__ import annotations

import atexit
import copy
import os
import shutil
import sys
import tempfile
import threading
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import assert_never

from instrument.clock import Clock
from instrument.config.axes import NewportAxis, OrientalAxis, Wired, ZaberAxis
from instrument.config.camera import V4l2CameraConfig
from instrument.devices import Image, Surface
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.newport_controller import NewportController
from sim.emulated.oriental_controller import OrientalController
from sim.emulated.v4l2.device import Description, EmulatedCamera, Exposure
from sim.emulated.v4l2.server import V4l2Server
from sim.emulated.v4l2.shim import compiled, environment
from sim.emulated.wire import Controller, PtyWire
from sim.emulated.zaber_controller import ZaberController
from sim.scene.scene import Scene
from sim.scene.sensor import Sensor

CAMERA_DEVICE = "/dev/v4l/by-id/emulated-gonio-camera"
_SOCKET = "GONIO_V4L2_SOCKET"
_FOLDER = "GONIO_V4L2_FOLDER"  # ours alone: removed when the program ends
_BEYOND_DEG = 5.0  # the emulated controllers' own limits lie this far past the rig file's
_FRAMES_PER_S = 400


def restart_with_camera() -> None:
    """Start the program again so that it sees the emulated camera, unless it does already.

    The loader takes the library that leads to the camera at the start of a process only.
    """
    if _SOCKET in os.environ:
        if _FOLDER in os.environ:
            atexit.register(shutil.rmtree, os.environ[_FOLDER], ignore_errors=True)
        return
    folder = Path(tempfile.mkdtemp(prefix="gonio-"))
    added = environment(compiled(folder), CAMERA_DEVICE, folder / "camera")
    added[_FOLDER] = str(folder)
    os.execve(
        sys.executable,
        [sys.executable, "-m", "acquisition", *sys.argv[1:]],
        {**os.environ, **added},
    )


@dataclass(frozen=True, slots=True)
class _SceneSnapshot:
    """What the scene looked like when an exposure began."""

    surface: Surface
    lit: bool
    step: int
    planned_s: float
    true_deg: Mapping[str, float]


class EmulatedBench:
    """The emulated devices over one scene, each plugged in when its driver is about to open it."""

    def __init__(self, scene: Scene, clock: Clock) -> None:
        self._scene, self._clock = scene, clock
        self._motors: dict[str, Motor] = {}
        self._closing = ExitStack()

    def close(self) -> None:
        """Take all devices away."""
        self._closing.close()

    def plug_axis(self, name: str, axis: Wired) -> str:
        """Put the axis's controller on a wire; returns the port that its driver opens."""
        low, high = axis.device_limits_deg()
        mechanics = Mechanics(
            low - _BEYOND_DEG,
            high + _BEYOND_DEG,
            axis.speed_deg_per_s,
            axis.acceleration_deg_per_s2,
            axis.to_device_deg(axis.home_deg),
            axis.homing_s / 2,
        )
        motor = Motor(mechanics, self._clock)
        wire = self._closing.enter_context(PtyWire([_controller(axis, motor)]))
        self._motors[name] = motor
        return wire.port

    def plug_camera(self, camera: V4l2CameraConfig) -> str:
        """Begin to answer as a camera; returns the device that its driver opens."""
        painted = copy.copy(self._scene)  # its own state; the caches are shared
        sensor, lock = Sensor(painted), threading.Lock()

        def render(exposure: Exposure, seen: object) -> Image:
            with lock:
                if isinstance(seen, _SceneSnapshot):
                    painted.surface, painted.lit = seen.surface, seen.lit
                    painted.begin_step(seen.step, seen.planned_s)
                    painted.true_deg = dict(seen.true_deg)
                return sensor.picture(exposure.exposure_s)

        device = EmulatedCamera(render, self._snapshot, _described(camera))
        self._closing.enter_context(V4l2Server(device, Path(os.environ[_SOCKET])))
        return CAMERA_DEVICE

    def _snapshot(self) -> _SceneSnapshot:
        scene = self._scene
        for name, motor in self._motors.items():
            scene.set_axis(name, scene.rig.axes[name].from_device_deg(motor.position_deg))
        state = (scene.surface, scene.lit, scene.step, scene.planned_s)
        return _SceneSnapshot(*state, dict(scene.true_deg))


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


def _described(camera: V4l2CameraConfig) -> Description:
    return Description(
        formats=(camera.pixel_format,),
        sizes=((camera.width_px, camera.height_px),),
        frames_per_s=_FRAMES_PER_S,
        overhead_s=min(camera.frame_overhead_s, 1 / _FRAMES_PER_S),
    )
