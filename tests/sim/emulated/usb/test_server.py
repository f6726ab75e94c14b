"""USB/IP server: lists, imports, unplugging and plugging again, and nothing left behind."""

from __future__ import annotations

import contextlib
import gc
import socket
import threading
import weakref
from collections.abc import Callable

import pytest

from sim.emulated.usb import usbip
from sim.emulated.usb.acm_port import AcmWire
from sim.emulated.usb.server import UsbIpServer
from sim.emulated.usb.usbip import ProtocolError
from sim.emulated.usb.uvc_camera import UvcCamera
from sim.emulated.usb.uvc_descriptors import Probe, interval
from sim.emulated.v4l2.device import EmulatedCamera
from tests.support.timing.deadline import wait_for
from tests.support.usb.cameras import QUICK, RATES, imported_camera, render
from tests.support.usb.left_behind import nothing_left_behind
from tests.support.usb.usbip_client import DEADLINE_S, UsbIpClient, imported, listed
from tests.support.usb.uvc_host import UvcHost

Y16 = Probe(3, 1, interval(RATES[0]))


def camera() -> UvcCamera:
    return UvcCamera(EmulatedCamera(render, capabilities=QUICK), RATES)


def test_devices_are_listed_with_their_interfaces() -> None:
    with (
        AcmWire([]) as wire,
        UsbIpServer({"1-1": camera(), "1-2": wire.device}) as server,
    ):
        first, second = listed(server.port)
        assert (first.busid, first.busnum, first.devnum) == ("1-1", 1, 1)
        assert (second.busid, second.busnum, second.devnum) == ("1-2", 1, 2)
        assert first.speed == usbip.HIGH_SPEED
        assert second.speed == usbip.FULL_SPEED
        assert (first.id_vendor, first.id_product, second.id_product) == (0x1209, 1, 2)
        assert first.interfaces == ((0x0E, 1, 0), (0x0E, 2, 0))
        assert second.interfaces == ((0x02, 2, 1), (0x0A, 0, 0))
        with imported(server.port, "1-2") as client:
            assert client.device == second._replace(interfaces=())


def test_a_device_is_imported_once_at_a_time() -> None:
    with UsbIpServer({"1-1": camera()}, release_s=0.05) as server, imported(server.port):
        assert server.imported("1-1")
        for busid in ("1-1", "1-9"):
            with pytest.raises(ProtocolError, match="status 1"), imported(server.port, busid):
                pass


def test_a_device_is_free_as_soon_as_the_computer_has_disconnected() -> None:
    with UsbIpServer({"1-1": camera()}) as server:
        for _ in range(5):
            with imported(server.port):
                pass


def test_a_server_that_is_closed_keeps_nobody_waiting() -> None:
    refused: list[Exception] = []

    def wait() -> None:
        try:
            with imported(server.port):
                pass
        except (ProtocolError, EOFError, OSError) as error:
            refused.append(error)

    server = UsbIpServer({"1-1": camera()}, release_s=10 * DEADLINE_S)
    with imported(server.port):
        waiting = threading.Thread(target=wait)
        waiting.start()
        wait_for(lambda: server.connections == 2, "the second connection")
        server.close()
        waiting.join(DEADLINE_S)
    assert len(refused) == 1


def test_unplugged_in_mid_stream_and_imported_again_with_default_settings() -> None:
    with imported_camera() as bench:
        for _ in range(3):
            bench.server.unplug("1-1")
            assert not bench.server.imported("1-1")
            with imported(bench.server.port) as client:
                host = UvcHost(client)
                assert host.get("GAIN") == 100
                host.set("GAIN", 50)
                host.start(Y16)
                assert host.frame().data
                bench.server.unplug("1-1")
                with pytest.raises((EOFError, OSError)):
                    [host.frame() for _ in range(1000)]


def test_a_model_that_is_unplugged_cannot_be_imported() -> None:
    device = camera()
    with UsbIpServer({"1-1": device}) as server:
        with imported(server.port):
            device.camera.unplug()
        with pytest.raises(ProtocolError), imported(server.port):
            pass
        device.camera.replug()
        with imported(server.port) as client:
            assert UvcHost(client).get("GAIN") == 100


def test_unplugging_what_nobody_has_imported() -> None:
    with UsbIpServer({"1-1": camera()}) as server:
        server.unplug("1-1")
        server.unplug("1-9")
        with imported(server.port):
            pass


def test_nonsense_ends_the_connection_and_not_the_server() -> None:
    with UsbIpServer({"1-1": camera()}) as server:
        for nonsense in (b"GET / HTTP/1.1", b"\x01", usbip.pack_import_request("1-1")[:9]):
            with socket.create_connection(("127.0.0.1", server.port), DEADLINE_S) as connection:
                connection.sendall(nonsense)
                with contextlib.suppress(OSError):  # closed already
                    connection.shutdown(socket.SHUT_WR)
                assert ended(lambda: connection.recv(1))
        with imported(server.port) as client:
            client.send_raw(48 * b"\xff")
            assert ended(client.reply)
        with imported(server.port):
            pass


def ended(read: Callable[[], object]) -> bool:
    """True if the server has closed the connection."""
    try:
        return not read()
    except (EOFError, ConnectionResetError):
        return True


def test_nothing_is_left_behind() -> None:
    with nothing_left_behind():
        for _ in range(5):
            with imported_camera() as bench:
                bench.host.start(Y16)
                bench.host.frame()
    with nothing_left_behind(), AcmWire([]) as wire:
        server = UsbIpServer({"1-1": camera(), "1-2": wire.device})
        with imported(server.port) as first, imported(server.port, "1-2"):
            UvcHost(first).start(Y16)
            server.close()  # while devices are imported and stream
            server.close()
        with pytest.raises(OSError, match="refused"), imported(server.port):
            pass


def test_a_device_keeps_no_cable_that_was_pulled() -> None:
    device = camera()
    with UsbIpServer({"1-1": device}) as server, imported(server.port):
        assert device.cable is not None
        cable = weakref.ref(device.cable)
    gc.collect()
    assert cable() is None


def test_computers_that_come_and_go_in_mid_stream() -> None:
    """The other end may end at any time, also while it does not read."""
    with nothing_left_behind(), UsbIpServer({"1-1": camera()}) as server:
        for frames in (0, 1, 2):
            with imported(server.port) as client:
                host = UvcHost(client)
                host.start(Y16)
                for _ in range(frames):
                    host.frame()


def test_two_computers_at_once_never_get_the_same_device() -> None:
    taken: list[UsbIpClient] = []
    most: list[int] = []
    lock = threading.Lock()

    def take(port: int) -> None:
        for _ in range(10):
            with imported(port) as client:
                with lock:
                    taken.append(client)
                    most.append(len(taken))
                client.control_in(0, 6, 1 << 8, 0, 18)
                with lock:
                    taken.remove(client)

    with UsbIpServer({"1-1": camera()}) as server:
        threads = [threading.Thread(target=take, args=(server.port,)) for _ in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(DEADLINE_S)
        wait_for(lambda: not server.imported("1-1"), "the end of the last import")
    assert len(most) == 20
    assert max(most) == 1
