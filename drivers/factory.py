"""Open the driver that a rig file names; axes on the same port share its line.

`instrument.config.axes.Wired` lists the kinds of motor drivers. mypy checks that this module and
`sim.emulated.bench` handle each of them; at run time a kind without a driver is an error.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING, TypeVar, assert_never

from drivers.lines.device_lock import DeviceLock
from drivers.lines.serial_line import Line
from drivers.stages.motion import Limits
from drivers.stages.motor_stage import MotorStage
from instrument.clock import Clock
from instrument.closeable import Closeable
from instrument.config.axes import NewportAxis, OphydAxis, OrientalAxis, Wired, ZaberAxis
from instrument.config.camera import V4l2CameraConfig
from instrument.devices import Camera

if TYPE_CHECKING:
    from drivers.lines.modbus_bus import ModbusBus
    from drivers.lines.modbus_client import BusSettings
    from drivers.v4l2.settings import V4l2Settings


Port = TypeVar("Port", bound=Closeable)


class Lines(Closeable):
    """The open ports, each opened once and shared; use it in a `with` statement."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self._serial: dict[str, Line] = {}
        self._modbus: dict[str, ModbusBus] = {}
        self._closing = ExitStack()

    def close(self) -> None:
        """Close all ports; safe to call twice."""
        self._closing.close()

    def serial(
        self, who: str, port: str, baudrate: int, reply_s: float, xonxoff: bool = False
    ) -> Line:
        """Return the line of a serial port; the first call opens it."""
        if port not in self._serial:
            self._serial[port] = self._open(
                who, port, lambda: Line(who, port, baudrate, self.clock, xonxoff, reply_s)
            )
        return self._serial[port]

    def modbus(self, who: str, settings: BusSettings) -> ModbusBus:
        """Return the bus of a Modbus port; the first call opens it."""
        from drivers.lines.modbus_bus import ModbusBus

        if settings.port not in self._modbus:
            self._modbus[settings.port] = self._open(
                who, settings.port, lambda: ModbusBus(who, settings, self.clock)
            )
        return self._modbus[settings.port]

    def _open(self, who: str, port: str, make: Callable[[], Port]) -> Port:
        """Lock a port and open it; the lock ends with it, or at once if it does not open."""
        with ExitStack() as opening:
            opening.enter_context(DeviceLock(who, port))
            opened = make()
            opening.callback(opened.close)
            self._closing.push(opening.pop_all())
        return opened


def open_stage(name: str, axis: Wired, port: str, lines: Lines) -> MotorStage:
    """Open the stage of an axis; raise `DeviceError` if no device or another one answers."""
    match axis:
        case NewportAxis():
            return _newport(name, axis, port, lines)
        case ZaberAxis():
            return _zaber(name, axis, port, lines)
        case OrientalAxis():
            return _oriental(name, axis, port, lines)
        case _:
            assert_never(axis)


def _newport(name: str, axis: NewportAxis, port: str, lines: Lines) -> MotorStage:
    from drivers.stages.newport import BAUDRATE, NewportStage

    baudrate, xonxoff = BAUDRATE[axis.model], axis.model == "SMC100"
    line = lines.serial(name, port, baudrate, axis.reply_s, xonxoff)
    return NewportStage(name, line, axis.address, axis.model, _limits(axis), lines.clock)


def _zaber(name: str, axis: ZaberAxis, port: str, lines: Lines) -> MotorStage:
    from drivers.stages.zaber import ZaberStage

    line = lines.serial(name, port, axis.baudrate, axis.reply_s)
    device, number, per_deg = axis.device, axis.axis, axis.microsteps_per_deg
    return ZaberStage(name, line, device, number, per_deg, _limits(axis), lines.clock)


def _oriental(name: str, axis: OrientalAxis, port: str, lines: Lines) -> MotorStage:
    from drivers.lines.modbus_client import BusSettings
    from drivers.stages.oriental import OrientalStage

    bus = lines.modbus(name, BusSettings(port, axis.baudrate, axis.parity, axis.reply_s))
    return OrientalStage(name, bus, axis.unit, axis.steps_per_deg, _limits(axis), lines.clock)


def open_ophyd(name: str, axis: OphydAxis, clock: Clock) -> MotorStage:
    """Connect the motor of another control system; raise `DeviceError` if it is not there."""
    from drivers.ophyd.stage import OphydStage

    return OphydStage(name, axis.motor, axis.prefix, _limits(axis), clock)


def _limits(axis: Wired | OphydAxis) -> Limits:
    low, high = axis.device_limits_deg()
    return Limits(
        min_deg=low,
        max_deg=high,
        speed_deg_per_s=axis.speed_deg_per_s,
        acceleration_deg_per_s2=axis.acceleration_deg_per_s2,
        tolerance_deg=axis.tolerance_deg,
        homing_s=axis.homing_s,
        home_deg=axis.to_device_deg(axis.home_deg),
    )


def open_camera(camera: V4l2CameraConfig, device: str, clock: Clock) -> Camera:
    """Open the camera; raise `DeviceError` if it cannot do what the rig file asks for."""
    from drivers.v4l2.camera import V4l2Camera

    return V4l2Camera(v4l2_settings(camera, device), clock)


def v4l2_settings(camera: V4l2CameraConfig, device: str) -> V4l2Settings:
    """Return the driver's settings of a rig file's camera, with the path of its device."""
    from drivers.v4l2.settings import V4l2Settings

    return V4l2Settings(
        device=device,
        pixel_format=camera.pixel_format,
        width_px=camera.width_px,
        height_px=camera.height_px,
        bit_depth=camera.bit_depth,
        min_exposure_s=camera.min_exposure_s,
        max_exposure_s=camera.max_exposure_s,
        gain=camera.gain,
        exposure_delay_frames=camera.exposure_delay_frames,
        frames_per_s=camera.frames_per_s,
        limited_range=camera.luma_range == "limited",
    )
