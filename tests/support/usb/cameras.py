"""Emulated UVC cameras for tests, whose pixels say how they were exposed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.emulated.usb.server import UsbIpServer
from sim.emulated.usb.uvc_camera import UvcCamera
from sim.emulated.v4l2.device import BYTES_PER_PIXEL, Capabilities, EmulatedCamera, Exposure
from tests.support.usb.usbip_client import imported
from tests.support.usb.uvc_host import UvcHost

QUICK = Capabilities(
    card="Mono camera", sizes=((64, 48), (200, 100)), frames_per_s=500, overhead_s=0.0005
)
RATES = (500, 250, 100)


def render(exposure: Exposure, seen: object) -> NDArray[Any]:
    """Picture without two equal neighbours; its first row says exposure, gain and number."""
    shape = (exposure.height_px, exposure.width_px)
    wide = BYTES_PER_PIXEL[exposure.pixel_format] == 2 and exposure.pixel_format != "YUYV"
    top = 65521 if wide else 251
    image = (np.arange(shape[0] * shape[1]) * 7 % top).reshape(shape)
    head = [round(exposure.exposure_s * 10_000), exposure.gain, exposure.sequence]
    image[0, :3] = np.array(head) % (65536 if wide else 256)
    return image.astype(np.uint16 if wide else np.uint8)


@dataclass
class Bench:
    """Emulated camera, its server, and the host that has imported it."""

    camera: EmulatedCamera
    server: UsbIpServer
    host: UvcHost
    begun: list[None]

    @property
    def exposed(self) -> int:
        """Number of exposures begun."""
        return len(self.begun)


@contextmanager
def imported_camera(capabilities: Capabilities = QUICK, **changes: Any) -> Iterator[Bench]:
    """Import a camera; the defects and properties of the model may be changed."""
    begun: list[None] = []
    camera = EmulatedCamera(render, lambda: begun.append(None), replace(capabilities, **changes))
    with (
        UsbIpServer({"1-1": UvcCamera(camera, RATES)}) as server,
        imported(server.port) as client,
    ):
        client.control_out(0, 9, 1, 0)  # SET_CONFIGURATION
        yield Bench(camera, server, UvcHost(client), begun)
