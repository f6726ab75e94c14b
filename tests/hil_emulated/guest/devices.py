"""Devices of the guest by name: where udev links them, and how they are plugged in."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

from sim.emulated.usb import vhci

USB = "GONIO_EMULATED_USB"  # environment variable in the guest: host:port of the USB/IP server
_SERIAL = "/dev/serial/by-id/"
CAMERA = "/dev/v4l/by-id/usb-Emulated_Optics_Emulated_camera_CAMERA-video-index0"
METADATA = CAMERA.replace("index0", "index1")
PORTS = {
    "SMC100": _SERIAL + "usb-QEMU_QEMU_USB_SERIAL_SMC100-if00-port0",
    "AZ": _SERIAL + "usb-QEMU_QEMU_USB_SERIAL_AZ-if00-port0",
    "X-RSW": _SERIAL + "usb-QEMU_QEMU_USB_SERIAL_X-RSW-if00-port0",
    "ZABER": _SERIAL + "usb-Emulated_Mechanics_Goniometer_stage_ZABER-if00",
    "SMC100-ACM": _SERIAL + "usb-Emulated_Mechanics_Goniometer_stage_SMC100-ACM-if00",
}
BUS_IDS = {"1-1": CAMERA, "1-2": PORTS["ZABER"], "1-3": PORTS["SMC100-ACM"]}
DEADLINE_S = 30.0


def plug_in(bus_id: str) -> None:
    """Import a USB device from the host."""
    host, port = os.environ[USB].split(":")
    vhci.attach(host, int(port), bus_id)


def wait_for_node(path: str, there: bool = True) -> str:
    """Wait until udev has made or removed a link; return the node that it points to."""
    wait_until(lambda: Path(path).exists() == there, f"{path} {'there' if there else 'gone'}")
    return os.path.realpath(path)


def wait_until(condition: Callable[[], bool], what: str, deadline_s: float = DEADLINE_S) -> None:
    """Return once the condition is true; fail at the deadline."""
    until_s = time.monotonic() + deadline_s
    while not condition():
        assert time.monotonic() < until_s, f"{what}: not within {deadline_s:g} s"
        time.sleep(0.01)
