"""USB/IP server: lists emulated devices and exports each to one computer at a time."""

from __future__ import annotations

import contextlib
import logging
import socket
import threading
from collections.abc import Mapping

from instrument.closeable import Closeable
from sim.emulated.usb import descriptors, usbip
from sim.emulated.usb.device import UsbDevice
from sim.emulated.usb.link import Link
from sim.emulated.usb.usbip import ExportedDevice, ProtocolError

_BUS = 1
_log = logging.getLogger(__name__)


def exported(device: UsbDevice, busid: str, devnum: int) -> ExportedDevice:
    """Return the description of a device in the server's list."""
    own = device.identity
    return ExportedDevice(
        path=f"/emulated/usb{_BUS}/{busid}",
        busid=busid,
        busnum=_BUS,
        devnum=devnum,
        speed=device.speed,
        id_vendor=own.id_vendor,
        id_product=own.id_product,
        bcd_device=own.bcd_device,
        device_class=descriptors.MISCELLANEOUS[0],
        device_subclass=descriptors.MISCELLANEOUS[1],
        device_protocol=descriptors.MISCELLANEOUS[2],
        configuration_value=1,
        configurations=1,
        interfaces=descriptors.interfaces(device.configuration),
    )


class UsbIpServer(Closeable):
    """Server on the loopback interface; `port` is its TCP port, chosen by the system if 0 is given.

    devices: by busid, such as "1-1". A device that was unplugged can be imported again. release_s:
    time that an import waits for the one before it to end, as a computer detaches in its own time.
    """

    def __init__(
        self, devices: Mapping[str, UsbDevice], port: int = 0, release_s: float = 5.0
    ) -> None:
        self._release_s = release_s
        self._devices = dict(devices)
        self._exported = {
            busid: exported(device, busid, number)
            for number, (busid, device) in enumerate(self._devices.items(), 1)
        }
        self._links: dict[str, Link] = {}
        self._connections: dict[socket.socket, threading.Thread] = {}
        self._change = threading.Condition()
        self._closing = False
        self._listener = socket.create_server(("127.0.0.1", port))
        self.port: int = self._listener.getsockname()[1]
        self._thread = threading.Thread(target=self._accept, daemon=True, name="usbip server")
        self._thread.start()

    def close(self) -> None:
        """Pull all devices and stop serving."""
        with contextlib.suppress(OSError):  # closed before
            self._listener.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._listener.close()
        with self._change:
            self._closing = True
            self._change.notify_all()
            ending = dict(self._connections)
            for connection in ending:
                with contextlib.suppress(OSError):  # disconnected meanwhile
                    connection.shutdown(socket.SHUT_RDWR)
        for thread in ending.values():
            thread.join()

    def unplug(self, busid: str) -> None:
        """Pull the device's cable; return when it is free for the next import."""
        with self._change:
            link = self._links.get(busid)
        if link is not None:
            link.pull()
            with self._change:
                self._change.wait_for(lambda: self._links.get(busid) is not link)

    @property
    def connections(self) -> int:
        """Number of connected computers."""
        with self._change:
            return len(self._connections)

    def imported(self, busid: str) -> bool:
        """Return True while a computer has imported the device."""
        with self._change:
            return busid in self._links

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return  # closed
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            thread = threading.Thread(
                target=self._serve, args=(connection,), daemon=True, name="usbip connection"
            )
            with self._change:
                self._connections[connection] = thread
            thread.start()

    def _serve(self, connection: socket.socket) -> None:
        try:
            busid = usbip.read_request(usbip.exactly(connection.recv))
            if busid is None:
                connection.sendall(usbip.pack_list_reply(list(self._exported.values())))
            else:
                self._export(connection, busid)
        except ProtocolError as error:
            _log.warning("USB/IP client disconnected: %s", error)
        except (EOFError, OSError):
            pass  # the client has disconnected
        finally:
            with self._change:
                del self._connections[connection]
                connection.close()

    def _export(self, connection: socket.socket, busid: str) -> None:
        link = self._claim(connection, busid)
        if link is None:
            connection.sendall(usbip.pack_import_reply(None))
            return
        try:
            link.serve(usbip.pack_import_reply(self._exported[busid]))
        finally:
            with self._change:
                del self._links[busid]
                self._change.notify_all()

    def _claim(self, connection: socket.socket, busid: str) -> Link | None:
        """Return the link for a device; None if there is no such device or it stays in use."""
        with self._change:
            self._change.wait_for(
                lambda: busid not in self._links or self._closing, self._release_s
            )
            device = self._devices.get(busid)
            if busid in self._links or device is None or not device.present:
                return None
            link = self._links[busid] = Link(connection, device)
            return link
