"""Controls of a UVC camera, answered from the model of an emulated camera."""

from __future__ import annotations

import errno
from collections.abc import Mapping
from typing import NamedTuple

from drivers.v4l2 import ioctl
from sim.emulated.usb.uvc_descriptors import CAMERA_TERMINAL, PROCESSING_UNIT
from sim.emulated.v4l2.device import BRIGHTNESS, EmulatedCamera, Refused

REQUESTS = {  # UVC 1.1, A.8
    0x01: "SET_CUR",
    0x81: "GET_CUR",
    0x82: "GET_MIN",
    0x83: "GET_MAX",
    0x84: "GET_RES",
    0x85: "GET_LEN",
    0x86: "GET_INFO",
    0x87: "GET_DEF",
}
_GET_AND_SET = 3  # capabilities in GET_INFO
# Bits of AE_MODE by number in V4L2's menu: automatic, manual, shutter priority, aperture priority
_AE_BITS = (2, 1, 4, 8)
_AE_SUPPORTED = 1 | 8


class UvcControl(NamedTuple):
    """A control of a terminal or unit (A.9.4, A.9.5), and the number of its V4L2 control.

    `bit` is its place in bmControls, `size` its number of bytes.
    """

    name: str
    entity: int
    selector: int
    bit: int
    size: int
    number: int


CONTROLS = (
    UvcControl("AE_MODE", CAMERA_TERMINAL, 0x02, 1, 1, ioctl.EXPOSURE_AUTO),
    UvcControl("EXPOSURE_TIME_ABSOLUTE", CAMERA_TERMINAL, 0x04, 3, 4, ioctl.EXPOSURE_ABSOLUTE),
    UvcControl("BRIGHTNESS", PROCESSING_UNIT, 0x02, 0, 2, BRIGHTNESS),
    UvcControl("GAIN", PROCESSING_UNIT, 0x04, 9, 2, ioctl.GAIN),
    UvcControl("GAMMA", PROCESSING_UNIT, 0x09, 5, 2, ioctl.GAMMA),
    UvcControl(
        "WHITE_BALANCE_TEMPERATURE_AUTO", PROCESSING_UNIT, 0x0B, 12, 1, ioctl.AUTO_WHITE_BALANCE
    ),
)


class UvcControls:
    """Controls that the model of a camera has, as the camera's units answer for them."""

    def __init__(self, camera: EmulatedCamera) -> None:
        self._camera = camera
        present = camera.controls()
        self._controls = {(c.entity, c.selector): c for c in CONTROLS if c.number in present}

    def bits(self, entity: int) -> list[int]:
        """Return the bits in bmControls of a terminal or unit."""
        return [c.bit for c in self._controls.values() if c.entity == entity]

    def find(self, entity: int, selector: int) -> UvcControl | None:
        """Return a control; None if the camera has no such control."""
        return self._controls.get((entity, selector))

    def answer(self, control: UvcControl, request: str, data: bytes) -> bytes:
        """Carry out a request; raise `Refused` where the model refuses it."""
        if request == "GET_LEN":
            return control.size.to_bytes(2, "little")
        if request == "GET_INFO":
            return bytes([_GET_AND_SET])
        if request == "SET_CUR":
            self._set(control, int.from_bytes(data[: control.size], "little"))
            return b""
        return self._values(control)[request].to_bytes(control.size, "little")

    def _set(self, control: UvcControl, value: int) -> None:
        if control.number == ioctl.EXPOSURE_AUTO:
            if value not in _AE_BITS or not value & _AE_SUPPORTED:
                raise Refused(errno.ERANGE)
            value = _AE_BITS.index(value)
        self._camera.set_value(control.number, value)

    def _values(self, control: UvcControl) -> Mapping[str, int]:
        found = self._camera.controls()[control.number]
        present, default = self._camera.value(control.number), found.default
        limits = (found.minimum, found.maximum, found.step)
        if control.number == ioctl.EXPOSURE_AUTO:
            present, default = _AE_BITS[present], _AE_BITS[default]
            limits = (min(_AE_BITS), max(_AE_BITS), _AE_SUPPORTED)
        names = ("GET_CUR", "GET_DEF", "GET_MIN", "GET_MAX", "GET_RES")
        return dict(zip(names, (present, default, *limits), strict=True))
