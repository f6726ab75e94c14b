"""Import of USB/IP devices into the kernel of this computer, through vhci_hcd.

The side of the guest computer. Import-light, and needs no program: Linux takes a connected socket
and the device's number and speed in /sys/devices/platform/vhci_hcd.0/attach (drivers/usb/usbip/
vhci_sysfs.c). Needs root and the module vhci_hcd.
"""

from __future__ import annotations

import socket
from pathlib import Path

from sim.emulated.usb import usbip

SYSFS = Path("/sys/devices/platform/vhci_hcd.0")
_FREE = "004"  # VDEV_ST_NULL
_CONNECT_S = 10.0


def attach(host: str, port: int, busid: str, sysfs: Path = SYSFS) -> int:
    """Import a device; return the port of the virtual controller that it is plugged into."""
    with socket.create_connection((host, port), _CONNECT_S) as connection:
        connection.sendall(usbip.pack_import_request(busid))
        device = usbip.read_import_reply(usbip.exactly(connection.recv))
        connection.settimeout(None)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        free = free_port((sysfs / "status").read_text(), device.speed)
        words = f"{free} {connection.fileno()} {device.devid} {device.speed}"
        (sysfs / "attach").write_text(words)  # the kernel keeps the socket
    return free


def detach(port: int, sysfs: Path = SYSFS) -> None:
    """Unplug the device at a port, from this computer's side."""
    (sysfs / "detach").write_text(str(port))


def free_port(status: str, speed: int) -> int:
    """Return the first free port for devices of this speed in the kernel's list of ports.

    Its lines are "hs  0000 004 000 00000000 000000 0-0": hub, port, state, and so on.
    """
    hub = "ss" if speed >= usbip.SUPER_SPEED else "hs"
    for line in status.splitlines():
        words = line.split()
        if words[:1] == [hub] and words[2] == _FREE:
            return int(words[1])
    raise RuntimeError(
        f"vhci_hcd has no free port on its hub {hub!r}: detach a device. Its ports are\n{status}"
    )
