"""Import through vhci_hcd, whose files are stood in for by a folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim.emulated.usb import usbip, vhci
from sim.emulated.usb.acm_port import AcmWire
from sim.emulated.usb.server import UsbIpServer
from sim.emulated.usb.usbip import ProtocolError
from tests.support.timing.deadline import wait_for

# As Linux 6.1 lists its ports (drivers/usb/usbip/vhci_sysfs.c), the first one in use.
STATUS = """hub port sta spd dev      sockfd local_busid
hs  0000 006 003 00010002 000003 1-1
hs  0001 005 000 00000000 000000 0-0
hs  0002 004 000 00000000 000000 0-0
ss  0008 004 000 00000000 000000 0-0
"""


def test_the_first_free_port_of_the_right_hub() -> None:
    for speed in (usbip.LOW_SPEED, usbip.FULL_SPEED, usbip.HIGH_SPEED):
        assert vhci.free_port(STATUS, speed) == 2
    assert vhci.free_port(STATUS, usbip.SUPER_SPEED) == 8
    with pytest.raises(RuntimeError, match="no free port on its hub 'hs'"):
        vhci.free_port(STATUS.replace("004", "006"), usbip.HIGH_SPEED)


def test_attach_gives_port_socket_number_and_speed_to_the_kernel(tmp_path: Path) -> None:
    (tmp_path / "status").write_text(STATUS)
    with AcmWire([]) as wire, UsbIpServer({"1-1": wire.device}) as server:
        assert vhci.attach("127.0.0.1", server.port, "1-1", tmp_path) == 2
        port, socket, number, speed = map(int, (tmp_path / "attach").read_text().split())
        assert (port, number, speed) == (2, 1 << 16 | 1, usbip.FULL_SPEED)
        assert socket > 2
        # Nobody has kept the socket here, as the kernel would.
        wait_for(lambda: not server.imported("1-1"), "the end of the import")
        with pytest.raises(ProtocolError, match="refused"):
            vhci.attach("127.0.0.1", server.port, "1-9", tmp_path)


def test_detach_names_the_port(tmp_path: Path) -> None:
    vhci.detach(3, tmp_path)
    assert (tmp_path / "detach").read_text() == "3"
