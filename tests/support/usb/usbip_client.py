"""USB/IP client for tests: imports an emulated device and exchanges transfers, as vhci does."""

from __future__ import annotations

import socket
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager

from sim.emulated.usb import usbip
from sim.emulated.usb.device import Setup, Stall
from sim.emulated.usb.usbip import Submit, Submitted, Unlink, Unlinked

DEADLINE_S = 20.0
_EPIPE = -32
_IN = 0x80


class UsbIpClient:
    """Computer that has imported a device; use within `imported`."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._read = usbip.exactly(connection.recv)
        self._seqnum = 0
        self._directions: dict[int, int] = {}
        self._arrived: deque[Submitted | Unlinked] = deque()
        self.device: usbip.ExportedDevice

    def import_device(self, busid: str) -> None:
        self._connection.sendall(usbip.pack_import_request(busid))
        self.device = usbip.read_import_reply(self._read)

    # Transfers

    def submit(self, address: int, length: int, data: bytes = b"", setup: bytes = bytes(8)) -> int:
        """Send a transfer; return its number."""
        self._seqnum += 1
        direction = usbip.IN if address & _IN else usbip.OUT
        self._directions[self._seqnum] = direction
        command = Submit(
            self._seqnum, self.device.devid, direction, address & 0x7F, length, setup, data
        )
        self._connection.sendall(usbip.pack_command(command))
        return self._seqnum

    def unlink(self, seqnum: int) -> int:
        """Send the withdrawal of a transfer; return its own number."""
        self._seqnum += 1
        self._connection.sendall(
            usbip.pack_command(Unlink(self._seqnum, self.device.devid, seqnum))
        )
        return self._seqnum

    def send_raw(self, data: bytes) -> None:
        self._connection.sendall(data)

    def reply(self) -> Submitted | Unlinked:
        """Next reply in order of arrival."""
        if self._arrived:
            return self._arrived.popleft()
        return self._receive()

    def reply_to(self, seqnum: int) -> Submitted | Unlinked:
        """Reply to one command; others that come before it are kept."""
        kept: list[Submitted | Unlinked] = []
        while (found := self.reply()).seqnum != seqnum:
            kept.append(found)
        self._arrived.extendleft(reversed(kept))
        return found

    def _receive(self) -> Submitted | Unlinked:
        return usbip.read_reply(self._read, lambda n: self._directions.get(n) == usbip.IN)

    # Requests

    def control_in(
        self, request_type: int, request: int, value: int, index: int, length: int
    ) -> bytes:
        setup = Setup(request_type | _IN, request, value, index, length)
        return self._control(setup, b"").data

    def control_out(
        self, request_type: int, request: int, value: int, index: int, data: bytes = b""
    ) -> None:
        setup = Setup(request_type, request, value, index, len(data))
        assert self._control(setup, data).actual_length == len(data)

    def _control(self, setup: Setup, data: bytes) -> Submitted:
        address = setup.request_type & _IN
        done = self.reply_to(self.submit(address, setup.length, data, setup.pack()))
        assert isinstance(done, Submitted)
        if done.status == _EPIPE:
            raise Stall
        assert done.status == 0
        return done


@contextmanager
def imported(port: int, busid: str = "1-1") -> Iterator[UsbIpClient]:
    """Import a device from a server on this computer."""
    with socket.create_connection(("127.0.0.1", port), DEADLINE_S) as connection:
        client = UsbIpClient(connection)
        client.import_device(busid)
        yield client


def listed(port: int) -> list[usbip.ExportedDevice]:
    """Devices that a server on this computer exports."""
    with socket.create_connection(("127.0.0.1", port), DEADLINE_S) as connection:
        connection.sendall(usbip.pack_list_request())
        return usbip.read_list_reply(usbip.exactly(connection.recv))
