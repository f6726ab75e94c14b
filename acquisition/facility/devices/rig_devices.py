"""Devices of a rig file for bluesky: opened together, made safe and closed together."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from acquisition.engine.engine import Devices
from acquisition.engine.onlookers import KnownLamp
from acquisition.facility.devices.actions import ActionThread
from acquisition.facility.devices.axis_device import AxisDevice
from acquisition.facility.devices.camera_device import CameraDevice
from acquisition.facility.devices.lamp_device import LampDevice
from acquisition.facility.devices.motion import Motion
from acquisition.facility.devices.window_camera import Exposing, WindowCamera
from acquisition.results.model_check import check_model
from acquisition.rig import (
    open_all,
    open_devices,
    require_calibration_date,
    require_own_calibration,
)
from instrument.closeable import Closeable
from instrument.config.load import load_protocol, load_rig
from instrument.config.rig import Rig
from instrument.errors import InputError


def open_rig(rig: Path | str | None = None, protocol: Path | str | None = None) -> RigDevices:
    """Open the devices of a rig file for bluesky's run engine; nothing moves.

    protocol: protocol file, whose window, frames and exposures are taken, whose sample a simulated
    rig shows, and whose rig is opened where no other is named. Without one the window is 20 x 20 mm
    and a simulated rig shows a white sample. Use it in a `with` block: at its end all motion is
    stopped and the lamp's shutter closed. Raises `InputError` for a mistake in a file, and
    `DeviceError` if a device does not answer.
    """
    if protocol is not None:
        rig_path = None if rig is None else Path(rig)
        loaded = load_protocol(Path(protocol), rig_path, check_model=check_model)
        require_drivable(loaded.rig, loaded.rig_path)
        exposing = Exposing.of(loaded.protocol)
        return RigDevices(loaded.rig, loaded.rig_path, open_devices(loaded), exposing)
    if rig is None:
        raise InputError("open_rig: neither a rig file nor a protocol is named: name one")
    own = load_rig(Path(rig), calibrated=True)
    require_drivable(own, Path(rig))
    return RigDevices(own, Path(rig), open_all(own), Exposing())


def require_drivable(rig: Rig, path: Path) -> None:
    """Raise `InputError` for a rig that no other program can drive, or an old calibration."""
    if rig.emulated:
        raise InputError(
            f"{path}: its camera is emulated, which needs a process of its own: use the command "
            "gonio run, or a rig whose devices are simulated or real"
        )
    require_calibration_date(rig, path)
    if rig.real:
        from acquisition.terminal.operator import require_terminal

        require_terminal(str(path))


class RigDevices(Closeable):
    """Devices of one rig: `theta_i`, `dphi`, `theta_r`, `camera` and `lamp`.

    They share one thread, in which the rig does one thing after the other.
    """

    def __init__(self, rig: Rig, path: Path, devices: Devices, exposing: Exposing) -> None:
        self._thread, self.clock = ActionThread(), devices.clock
        lamp = KnownLamp(devices.lamp)
        devices = replace(devices, lamp=lamp)
        with ExitStack() as opening:
            opening.callback(devices.close)
            opening.callback(self._thread.close)
            require_own_calibration(rig, path, devices.camera)
            self._motion = Motion(rig, devices, self._thread)
            window = WindowCamera(rig, devices, lamp, self._motion, exposing)
            self._closing = opening.pop_all()
        self.theta_i, self.dphi, self.theta_r = (
            AxisDevice(name, self._motion, rig.axes[name], self.clock)
            for name in ("theta_i", "dphi", "theta_r")
        )
        shared = lamp, self._thread, self.clock
        self.camera = CameraDevice(rig, window, self._motion, *shared)
        self.lamp = LampDevice(rig, *shared)

    def ready(self) -> None:
        """Make the axes ready and wait for it; those without a reference are homed, which moves."""
        self._motion.begin_ready().wait()

    def close(self) -> None:
        """Stop all motion, close the shutter and release the devices; may be called twice."""
        if self._thread.closed:
            return
        self._motion.begin_halt()
        self._thread.begin(self._motion.make_safe)
        self._closing.close()
