"""Bench of the emulated computer: motors and camera on the host, over one scene."""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from instrument.clock import SystemClock
from instrument.closeable import Closeable
from instrument.config.axes import Wired
from instrument.config.camera import CameraConfig, CameraDefects, V4l2CameraConfig
from instrument.config.load import Loaded
from instrument.devices import Surface
from sim.emulated.bench import EmulatedBench
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.newport_controller import NewportController
from sim.emulated.usb.acm_port import AcmWire
from sim.emulated.usb.device import UsbDevice
from sim.emulated.usb.server import UsbIpServer
from sim.emulated.usb.uvc_camera import UvcCamera
from sim.emulated.v4l2.device import CameraFaults, Capabilities, EmulatedCamera, Exposure
from sim.emulated.wire import Controller
from sim.emulated.zaber_controller import ZaberController
from sim.scene.scene import Scene
from tests.hil_emulated.host.computer import Computer
from tests.support.command import gonio
from tests.support.stages.socket_wire import SocketWire, unix_listener
from tests.support.whole_scans.simulated_rig import Points, points, simulated

Look = Literal["levels", "surface", "scene"]
ADAPTERS = ("SMC100", "AZ", "X-RSW")
SPARE = Mechanics(speed_deg_per_s=40.0, acceleration_deg_per_s2=80.0, homing_s=0.5)
_LOOK_S = 0.01
SIZES = ((160, 128), (320, 240), (640, 480))


class HostBench(Closeable):
    """All devices; the guest calls the public methods by name.

    USB serial adapters by serial number: SMC100 (theta_i), AZ (dphi), X-RSW (a spare Zaber stage).
    USB devices by bus id: 1-1 camera, 1-2 ZABER (theta_r), 1-3 SMC100-ACM (a spare controller).
    """

    def __init__(self, loaded: Loaded, folder: Path) -> None:
        self._loaded, self._closing = loaded, ExitStack()
        self.computer: Computer | None = None
        self._scene = Scene.of(loaded.rig, loaded.protocol)
        self._scene.use_clock(SystemClock())
        bench = EmulatedBench(self._scene, SystemClock())
        controllers = _controllers(bench, loaded)
        spares = {"X-RSW": _spare(), "SMC100-ACM": _spare()}
        self.motors = {**bench.motors, **spares}
        controllers["X-RSW"] = ZaberController(spares["X-RSW"])
        controllers["SMC100-ACM"] = NewportController(spares["SMC100-ACM"])
        config = loaded.rig.camera
        assert isinstance(config, V4l2CameraConfig)
        self.camera = _ThreeLooks(config, bench.camera(config))
        self.adapters = {name: folder / name for name in ADAPTERS}
        for name, path in self.adapters.items():
            self._closing.enter_context(SocketWire([controllers[name]], unix_listener(path)))
        self.usb = self._closing.enter_context(UsbIpServer(self._usb_devices(controllers)))

    def _usb_devices(self, controllers: Mapping[str, Controller]) -> dict[str, UsbDevice]:
        """Connect the devices with a USB plug of their own; return them by bus id."""
        camera = UvcCamera(self.camera.device, rates=(20, 10, 5), serial="CAMERA")
        devices: dict[str, UsbDevice] = {"1-1": camera}
        for bus_id, name in (("1-2", "ZABER"), ("1-3", "SMC100-ACM")):
            wire = self._closing.enter_context(AcmWire([controllers[name]], serial=name))
            devices[bus_id] = wire.device
        return devices

    def close(self) -> None:
        """Disconnect all devices."""
        self._closing.close()

    def unplug(self, name: str) -> None:
        """Pull the plug of an adapter, or of a USB device."""
        if name in self.adapters:
            assert self.computer is not None
            self.computer.unplug(name)
        else:
            self.usb.unplug(name)

    def plug(self, name: str) -> None:
        """Plug an adapter in again; USB devices are imported by the guest."""
        assert self.computer is not None
        self.computer.plug(name)

    def unplug_in_sweep(self, name: str, motor: str, begin_deg: float, at_deg: float) -> None:
        """Pull a plug later: once a motor has been below `begin_deg`, and then above `at_deg`."""

        def pull() -> None:
            while self.position_deg(motor) > begin_deg:
                time.sleep(_LOOK_S)
            while self.position_deg(motor) < at_deg:
                time.sleep(_LOOK_S)
            self.unplug(name)

        threading.Thread(target=pull, daemon=True, name="pull").start()

    def position_deg(self, name: str) -> float:
        """Return a motor's position, in its own degrees."""
        return self.motors[name].position_deg

    def moving(self, name: str) -> bool:
        """Return True while a motor moves."""
        return self.motors[name].moving

    def show(self, look: Look) -> None:
        """Choose what the camera sees."""
        self.camera.look = look

    def reset_camera(self) -> None:
        """End all faults and defects of the camera."""
        self.camera.device.faults = CameraFaults()
        self.camera.device.capabilities = self.camera.capabilities

    def fault(self, **changes: Any) -> None:
        """Set faults of the camera, by the names of `CameraFaults`."""
        for name, value in changes.items():
            assert hasattr(self.camera.device.faults, name)
            setattr(self.camera.device.faults, name, value)

    def bad_frames(self, *kinds: Any) -> None:
        """Make the next frames bad."""
        self.camera.device.faults.bad_frames.extend(kinds)

    def defects(self, delay_frames: int = 0, **changes: Any) -> None:
        """Give the sensor defects, by the names of `CameraDefects`."""
        self.camera.device.capabilities = replace(
            self.camera.capabilities,
            delay_frames=delay_frames,
            defects=CameraDefects.model_validate(changes),
        )

    def stall(self, times: int) -> None:
        """Refuse the next requests to set a control."""
        self.camera.device.faults.fail("SET_CUR", times=times)

    def light(self, on: bool) -> None:
        """Uncover or cover the lamp."""
        self._scene.lit = on

    def place(self, surface: Surface) -> None:
        """Put sample or tile in its place."""
        self._scene.surface = surface

    def simulated_points(self) -> Points:
        """Return the points of the same scan with simulated devices."""
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            rig = folder / "rig.yaml"
            rig.write_text(simulated(self._loaded.rig_path.read_text()))
            done = gonio("run", self._loaded.protocol_path, "--rig", rig, "--out", folder / "run")
            assert done.returncode == 0, done.stderr
            return points(folder / "run")


def _controllers(bench: EmulatedBench, loaded: Loaded) -> dict[str, Controller]:
    """Return the controllers of the rig's axes, by the serial number of their port."""
    found: dict[str, Controller] = {}
    for name, serial in (("theta_i", "SMC100"), ("dphi", "AZ"), ("theta_r", "ZABER")):
        axis = loaded.rig.axes[name]
        assert isinstance(axis, Wired)
        found[serial] = bench.controller(name, axis)
    return found


def _spare() -> Motor:
    return Motor(SPARE, SystemClock())


class _ThreeLooks:
    """Camera that sees the scene, an evenly lit surface, or levels that tell how they were taken.

    levels: the first pixels of each image are its exposure in 100 µs, the gain and the number of
    the frame. surface: saturates at half of the longest exposure.
    """

    def __init__(self, config: CameraConfig, scene_camera: EmulatedCamera) -> None:
        self._config = config
        self.look: Look = "surface"
        self._random = np.random.default_rng(3)
        self._looks: dict[str, Callable[[Exposure, object], NDArray[Any]]] = {
            "levels": self._levels, "surface": self._surface, "scene": scene_camera.render,
        }  # fmt: skip
        self.capabilities: Capabilities = replace(
            scene_camera.capabilities, formats=("Y16", "GREY", "YUYV"), sizes=SIZES, frames_per_s=20
        )
        self.device = EmulatedCamera(self._render, scene_camera.snapshot, self.capabilities)

    def _render(self, exposure: Exposure, seen: object) -> NDArray[Any]:
        return self._looks[self.look](exposure, seen)

    def _levels(self, exposure: Exposure, _: object) -> NDArray[Any]:
        image = np.zeros((exposure.height_px, exposure.width_px), np.uint16)
        steps = round(exposure.exposure_s * 1e4)
        image[0, :4] = steps, exposure.gain, exposure.sequence % 256, exposure.sequence // 256
        return image if exposure.pixel_format == "Y16" else image.astype(np.uint8)

    def _surface(self, exposure: Exposure, _: object) -> NDArray[Any]:
        black, full = self._config.black_level_dn, self._config.max_dn
        light = 2 * (full - black) * exposure.exposure_s / self._config.max_exposure_s
        shape = (exposure.height_px, exposure.width_px)
        noise = self._random.normal(0, 1.5 + 0.1 * np.sqrt(light), shape)
        return np.clip(np.rint(black + light + noise), 0, full).astype(np.uint16)
