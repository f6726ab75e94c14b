"""Emulated UVC 1.1 camera: the model of `sim.emulated.v4l2.device` as a USB device.

The driver uvcvideo binds to it. Exposures, defects and faults are those of the model. Faults of
requests are named as in UVC: `camera.faults.fail("SET_CUR")` stalls the next request to set a
control, "SET_CUR GAIN" one for that control, "GET_CUR" one that reads it.

Transcripts: descriptors as of uncompressed bulk cameras in the UVC 1.1 documents. Not verified on a
device: numbers of terminals and units, range of the controls, the error codes after a stall. As in
small cameras without a memory, a frame that nobody awaits at the end of its exposure is lost.
Properties of the model that USB does not have (padding of rows, time stamps, states of buffers) are
ignored.
"""

from __future__ import annotations

import errno
import time
from collections.abc import Iterator

from sim.emulated.usb import usbip
from sim.emulated.usb.descriptors import DeviceIdentity
from sim.emulated.usb.device import Cable, Setup, Stall, UsbDevice
from sim.emulated.usb.uvc_controls import REQUESTS, UvcControls
from sim.emulated.usb.uvc_descriptors import (
    CAMERA_TERMINAL,
    CONTROL_INTERFACE,
    INTERFACE_ITSELF,
    PROBE_BYTES,
    PROCESSING_UNIT,
    STREAMING_INTERFACE,
    UNITS_PER_S,
    VIDEO_ENDPOINT,
    Format,
    Frame,
    Probe,
    configuration,
    interval,
)
from sim.emulated.v4l2.device import (
    BYTES_PER_PIXEL,
    EmulatedCamera,
    Exposure,
    PixelFormat,
    Refused,
)
from sim.emulated.v4l2.sensor import FreeRunningSensor

CODES: dict[PixelFormat, str] = {"GREY": "Y800", "Y10": "Y10 ", "Y16": "Y16 ", "YUYV": "YUY2"}
PAYLOAD_BYTES = 16_384  # uvcvideo's largest transfer: 32 packets of 512 bytes
HEADER_BYTES = 2
END_OF_HEADER, ERROR, END_OF_FRAME, FRAME_ID = 0x80, 0x40, 0x02, 0x01  # bmHeaderInfo (2.4.3.3)
_PROBE, _COMMIT = 1, 2
_REQUEST_ERROR_CODE = 2
_WRONG_STATE, _OUT_OF_RANGE, _INVALID_UNIT, _INVALID_CONTROL, _UNKNOWN = 2, 4, 5, 6, 0xFF
_ERROR_CODES = {errno.EACCES: _WRONG_STATE, errno.ERANGE: _OUT_OF_RANGE}
_PRODUCT_ID = 0x0001
_LATE_S = 0.02


class UvcCamera(UsbDevice):
    """A model of a camera as a USB device.

    `rates`: frames/s, the default first; none above the model's limit.
    """

    def __init__(
        self,
        camera: EmulatedCamera,
        rates: tuple[int, ...] = (30, 15, 5),
        manufacturer: str = "Emulated Optics",
        serial: str = "SN0042",
    ) -> None:
        limit = camera.capabilities.frames_per_s
        if not rates or max(rates) > limit:
            raise ValueError(f"rates {rates}: at least one, and none above the model's {limit}/s")
        self.camera = camera
        self._controls = UvcControls(camera)
        self._sensor = FreeRunningSensor(camera, self._read_out, self._interrupt)
        self._formats = _formats(camera, rates)
        self._probe = self._default = Probe(1, 1, self._formats[0].frames[0].intervals[0])
        self._error_code = self._frame_id = 0
        own = self._controls.bits(CAMERA_TERMINAL), self._controls.bits(PROCESSING_UNIT)
        super().__init__(
            DeviceIdentity(manufacturer, camera.capabilities.card, serial, _PRODUCT_ID),
            configuration(self._formats, *own),
            usbip.HIGH_SPEED,
        )

    # Plug

    @property
    def present(self) -> bool:
        """False while the model is unplugged."""
        return not self.camera.faults.unplugged

    def plug(self, cable: Cable) -> None:
        """Power up with default settings; unplugging the model pulls the cable."""
        super().plug(cable)
        self.camera.restart()
        self._probe = self._default
        self.camera.watch_unplug(cable.pull, True)

    def unplug(self) -> None:
        """Power down."""
        if self.cable is not None:
            self.camera.watch_unplug(self.cable.pull, False)
        self._sensor.stop()
        super().unplug()

    def stop_endpoint(self, endpoint: int) -> None:
        """Stop streaming: so uvcvideo ends a stream over a bulk endpoint."""
        if endpoint == VIDEO_ENDPOINT:
            self._sensor.stop()

    # Requests

    def class_request(self, setup: Setup, data: bytes) -> bytes:
        """Carry out a request for a control, or for the choice of format, size and rate."""
        request = REQUESTS.get(setup.request)
        selector, entity, interface = setup.value >> 8, setup.index >> 8, setup.index & 0xFF
        if request is None:
            raise Stall
        if interface == STREAMING_INTERFACE and selector in (_PROBE, _COMMIT):
            return self._negotiate(request, selector, data)
        if interface != CONTROL_INTERFACE:
            raise Stall
        if (entity, selector) == (INTERFACE_ITSELF, _REQUEST_ERROR_CODE):
            return self._last_error(request)
        return self._control(request, entity, selector, data)

    def _control(self, request: str, entity: int, selector: int, data: bytes) -> bytes:
        control = self._controls.find(entity, selector)
        if control is None:
            known = entity in (CAMERA_TERMINAL, PROCESSING_UNIT)
            self._error_code = _INVALID_CONTROL if known else _INVALID_UNIT
            raise Stall
        try:
            self.camera.admit(request)
            self.camera.admit(f"{request} {control.name}")
            answer = self._controls.answer(control, request, data)
        except Refused as refusal:
            self._error_code = _ERROR_CODES.get(refusal.number, _UNKNOWN)
            raise Stall from refusal
        self._error_code = 0
        return answer

    def _last_error(self, request: str) -> bytes:
        if request == "GET_INFO":
            return b"\1"  # can be read
        if request != "GET_CUR":
            raise Stall
        return bytes([self._error_code])

    def _negotiate(self, request: str, selector: int, data: bytes) -> bytes:
        name = "PROBE" if selector == _PROBE else "COMMIT"
        try:
            self.camera.admit(f"{request} {name}")
        except Refused as refusal:
            raise Stall from refusal
        if request == "SET_CUR":
            if len(data) != PROBE_BYTES:
                raise Stall(f"{name} of {len(data)} bytes")
            self._probe = self._nearest(Probe.parse(data))
            if selector == _COMMIT:
                self._start()
            return b""
        if request == "GET_LEN":
            return PROBE_BYTES.to_bytes(2, "little")
        if request == "GET_INFO":
            return b"\3"
        return self._completed(self._default if request == "GET_DEF" else self._probe).pack()

    def _nearest(self, asked: Probe) -> Probe:
        """Return the choice nearest to the one asked for, or what a fault puts in its place."""
        formats, sizes = self.camera.capabilities.formats, self.camera.capabilities.sizes
        name = formats[min(max(asked.format_index, 1), len(formats)) - 1]
        size = sizes[min(max(asked.frame_index, 1), len(sizes)) - 1]
        chosen = self.camera.nearest_format(name, *size)
        video = next(i for i, name in enumerate(formats, 1) if name == chosen.name)
        frame = sizes.index((chosen.width_px, chosen.height_px)) + 1
        known = self._formats[video - 1].frames[frame - 1].intervals
        return Probe(video, frame, min(known, key=lambda i: abs(i - asked.frame_interval)))

    def _completed(self, probe: Probe) -> Probe:
        """Return a choice with the size of its frames and payloads."""
        video = self._formats[probe.format_index - 1]
        size = video.frame_bytes(video.frames[probe.frame_index - 1])
        return Probe(*probe[:3], size, PAYLOAD_BYTES)

    # Stream

    def _start(self) -> None:
        self._sensor.stop()
        capabilities, probe = self.camera.capabilities, self._probe
        name = capabilities.formats[probe.format_index - 1]
        size = capabilities.sizes[probe.frame_index - 1]
        self.camera.set_format(self.camera.nearest_format(name, *size))
        self.camera.frame_interval_s = probe.frame_interval / UNITS_PER_S
        self._sensor.start()

    def _interrupt(self) -> None:
        if self.cable is not None:
            self.cable.wake()

    def _read_out(self, exposure: Exposure, snapshot: object, end_s: float) -> None:
        """Send a frame, if the computer awaits one at the end of its exposure.

        uvcvideo stamps a frame with the time of its first payload. That is a mere header, sent
        before the picture is rendered; if this thread woke too late even for that, the frame is
        lost, as its stamp would be wrong.
        """
        cable, faults = self.cable, self.camera.faults
        late_s = time.monotonic() - end_s
        if cable is None or faults.frozen or late_s > max(self.camera.frame_interval_s, _LATE_S):
            return
        if not cable.awaited(VIDEO_ENDPOINT):
            return
        bad = faults.bad_frames.popleft() if faults.bad_frames else None
        flags = END_OF_HEADER | self._frame_id | (ERROR if bad == "flagged" else 0)
        self._frame_id ^= FRAME_ID
        if not self._send(cable, bytes([HEADER_BYTES, flags])):
            return
        data = self.camera.frame_bytes(exposure, snapshot).tobytes()
        for payload in payloads(data[: len(data) // 2] if bad == "short" else data, flags):
            if not self._send(cable, payload):
                return

    def _send(self, cable: Cable, payload: bytes) -> bool:
        return cable.send(VIDEO_ENDPOINT, payload, lambda: self._sensor.running)


def payloads(frame: bytes, flags: int) -> Iterator[bytes]:
    """Yield a frame as payloads, each with a header of these flags; the last ends the frame."""
    step = PAYLOAD_BYTES - HEADER_BYTES
    for begin in range(0, len(frame), step):
        last = END_OF_FRAME if begin + step >= len(frame) else 0
        yield bytes([HEADER_BYTES, flags | last]) + frame[begin : begin + step]


def _formats(camera: EmulatedCamera, rates: tuple[int, ...]) -> list[Format]:
    intervals = tuple(interval(rate) for rate in rates)
    frames = tuple(Frame(*size, intervals) for size in camera.capabilities.sizes)
    return [
        Format(CODES[name], 8 * BYTES_PER_PIXEL[name], frames)
        for name in camera.capabilities.formats
    ]
