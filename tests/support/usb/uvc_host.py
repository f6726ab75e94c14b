"""Host side of a UVC camera for tests: requests and frame assembly in the order of uvcvideo."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.emulated.usb.usbip import Submitted
from sim.emulated.usb.uvc_camera import END_OF_FRAME, ERROR, FRAME_ID, PAYLOAD_BYTES
from sim.emulated.usb.uvc_controls import CONTROLS, REQUESTS
from sim.emulated.usb.uvc_descriptors import PROBE_BYTES, STREAMING_INTERFACE, VIDEO_ENDPOINT, Probe
from tests.support.usb.usbip_client import UsbIpClient

PROBE, COMMIT = 1, 2
_CLASS_TO_INTERFACE = 0x21
_URBS = 5  # UVC_URBS of Linux
_NUMBERS = {name: number for number, name in REQUESTS.items()}


class UvcFrame(NamedTuple):
    data: bytes
    flags: int  # bmHeaderInfo of its payloads, joined

    @property
    def flagged(self) -> bool:
        return bool(self.flags & ERROR)


class UvcHost:
    """Driver of one UVC camera."""

    def __init__(self, client: UsbIpClient) -> None:
        self.client = client
        self._urbs: deque[int] = deque()
        self._last_ids: set[int] = set()

    # Controls

    def get(self, name: str, request: str = "GET_CUR") -> int:
        control = next(c for c in CONTROLS if c.name == name)
        place = (control.selector << 8, control.entity << 8)
        raw = self.client.control_in(
            _CLASS_TO_INTERFACE,
            _NUMBERS[request],
            *place,
            {"GET_INFO": 1, "GET_LEN": 2}.get(request, control.size),
        )
        return int.from_bytes(raw, "little")

    def set(self, name: str, value: int) -> None:
        control = next(c for c in CONTROLS if c.name == name)
        data = value.to_bytes(control.size, "little")
        place = (control.selector << 8, control.entity << 8)
        self.client.control_out(_CLASS_TO_INTERFACE, _NUMBERS["SET_CUR"], *place, data)

    def last_error(self) -> int:
        return self.client.control_in(_CLASS_TO_INTERFACE, _NUMBERS["GET_CUR"], 2 << 8, 0, 1)[0]

    # Stream

    def negotiate(self, probe: Probe) -> Probe:
        """Probe, read back and commit; return what the camera has chosen."""
        self.streaming_control(PROBE, probe)
        chosen = self.probe()
        self.streaming_control(COMMIT, chosen)
        return chosen

    def streaming_control(self, selector: int, probe: Probe) -> None:
        self.client.control_out(
            _CLASS_TO_INTERFACE,
            _NUMBERS["SET_CUR"],
            selector << 8,
            STREAMING_INTERFACE,
            probe.pack(),
        )

    def probe(self, request: str = "GET_CUR") -> Probe:
        raw = self.client.control_in(
            _CLASS_TO_INTERFACE, _NUMBERS[request], PROBE << 8, STREAMING_INTERFACE, PROBE_BYTES
        )
        assert len(raw) == PROBE_BYTES
        sizes = [int.from_bytes(raw[i : i + 4], "little") for i in (18, 22)]
        return Probe(*Probe.parse(raw)[:3], *sizes)

    def start(self, probe: Probe, urbs: int = _URBS) -> Probe:
        chosen = self.negotiate(probe)
        for _ in range(urbs):
            self._urbs.append(self.client.submit(VIDEO_ENDPOINT, PAYLOAD_BYTES))
        return chosen

    def stop(self) -> None:
        """Withdraw all transfers and clear the endpoint's halt."""
        for urb in list(self._urbs):
            self.client.reply_to(self.client.unlink(urb))
        self._urbs.clear()
        self._last_ids.clear()
        self.client.control_out(0x02, 1, 0, VIDEO_ENDPOINT)

    def payload(self, resubmit: bool = True) -> bytes:
        urb = self._urbs.popleft()
        done = self.client.reply_to(urb)
        assert isinstance(done, Submitted)
        assert done.status == 0
        if resubmit:
            self._urbs.append(self.client.submit(VIDEO_ENDPOINT, PAYLOAD_BYTES))
        return done.data

    def frame(self) -> UvcFrame:
        """Next frame from its first payload on; its frame id is not that of the one before."""
        data, flags, ids = b"", 0, set()
        while not flags & END_OF_FRAME:
            payload = self.payload()
            data += payload[payload[0] :]
            flags |= payload[1]
            ids.add(payload[1] & FRAME_ID)
        assert len(ids) == 1
        assert ids != self._last_ids
        self._last_ids = ids
        return UvcFrame(data, flags)


def pixels(frame: UvcFrame, width_px: int, height_px: int, name: str) -> NDArray[np.uint16]:
    """Luminance of a frame, (rows, columns) in counts."""
    if name in ("Y16", "Y10"):
        return np.frombuffer(frame.data, "<u2").reshape(height_px, width_px)
    bytes_each = 2 if name == "YUYV" else 1
    return (
        np.frombuffer(frame.data, np.uint8)[::bytes_each]
        .reshape(height_px, width_px)
        .astype(np.uint16)
    )
