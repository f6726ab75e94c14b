"""USB serial port with a Newport controller behind it, through a USB/IP client."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from instrument.clock import SystemClock
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.newport_controller import VERSIONS, NewportController
from sim.emulated.usb import descriptors
from sim.emulated.usb.acm_port import (
    DATA_IN,
    DATA_OUT,
    GET_LINE_CODING,
    NOTIFICATIONS,
    SET_CONTROL_LINE_STATE,
    SET_LINE_CODING,
    AcmWire,
    LineCoding,
    configuration,
)
from sim.emulated.usb.device import Stall
from sim.emulated.usb.server import UsbIpServer
from sim.emulated.usb.usbip import Submitted
from sim.emulated.wire import Fault
from tests.support.timing.deadline import wait_for
from tests.support.usb.left_behind import nothing_left_behind
from tests.support.usb.usbip_client import UsbIpClient, imported

_CLASS_TO_INTERFACE = 0x21
_READ_BYTES = 128  # cdc_acm reads twice wMaxPacketSize
VERSION = f"1VE{VERSIONS['SMC100']}\r\n".encode()


class Port:
    """Program that uses the port, and the driver below it."""

    def __init__(self, client: UsbIpClient) -> None:
        self.client = client
        client.submit(NOTIFICATIONS, 10)
        self._reading = client.submit(DATA_IN, _READ_BYTES)

    def set_lines(self, dtr: bool) -> None:
        self.client.control_out(_CLASS_TO_INTERFACE, SET_CONTROL_LINE_STATE, 3 * dtr, 0)

    def write(self, data: bytes) -> None:
        done = self.client.reply_to(self.client.submit(DATA_OUT, len(data), data))
        assert done == Submitted(done.seqnum, 0, len(data))

    def read(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            done = self.client.reply_to(self._reading)
            assert isinstance(done, Submitted)
            assert done.status == 0
            data += done.data
            self._reading = self.client.submit(DATA_IN, _READ_BYTES)
        return data


def newport() -> NewportController:
    mechanics = Mechanics(min_deg=-95, max_deg=95, speed_deg_per_s=20, acceleration_deg_per_s2=40)
    return NewportController(Motor(mechanics, SystemClock()))


@contextmanager
def opened(wire: AcmWire, server: UsbIpServer) -> Iterator[Port]:
    with imported(server.port) as client:
        port = Port(client)
        port.set_lines(dtr=True)
        assert wire.device.open
        yield port


@pytest.fixture
def bench() -> Iterator[tuple[AcmWire, UsbIpServer]]:
    with AcmWire([newport()]) as wire, UsbIpServer({"1-1": wire.device}) as server:
        yield wire, server


def test_the_controller_answers(bench: tuple[AcmWire, UsbIpServer]) -> None:
    with opened(*bench) as port:
        for _ in range(3):
            port.write(b"1V")
            port.write(b"E\r\n")
            assert port.read(len(VERSION)) == VERSION
    assert [data for _, data in bench[0].seen[:2]] == [b"1V", b"E\r\n"]


def test_faults_of_a_wire(bench: tuple[AcmWire, UsbIpServer]) -> None:
    wire, server = bench
    with opened(wire, server) as port:
        wire.inject(Fault("truncate"), Fault("lose request"), Fault("drop"), None)
        port.write(b"1VE\r\n")
        assert port.read(len(VERSION) // 2) == VERSION[: len(VERSION) // 2]
        for _ in range(3):
            port.write(b"1VE\r\n")
        assert port.read(len(VERSION)) == VERSION
        assert wire.pending == 0


def test_unplugged_by_a_fault_and_plugged_again(bench: tuple[AcmWire, UsbIpServer]) -> None:
    wire, server = bench
    with opened(wire, server) as port:
        wire.inject(Fault("unplug"))
        port.client.submit(DATA_OUT, 5, b"1VE\r\n")
        with pytest.raises((EOFError, OSError)):
            port.read(1)
    wait_for(lambda: not wire.device.open, "the end of the import")
    with opened(wire, server) as port:
        port.write(b"1VE\r\n")
        assert port.read(len(VERSION)) == VERSION


def test_answers_to_a_closed_port_are_dropped(bench: tuple[AcmWire, UsbIpServer]) -> None:
    wire, server = bench
    with opened(wire, server) as port:
        port.set_lines(dtr=False)
        wire.inject(None, Fault("lose request"))
        for _ in range(2):
            port.write(b"1TS\r\n")
        wait_for(lambda: len(wire.seen) == 2, "the second request, after the first is answered")
        port.set_lines(dtr=True)
        port.write(b"1VE\r\n")
        assert port.read(len(VERSION)) == VERSION


def test_parameters_of_the_line(bench: tuple[AcmWire, UsbIpServer]) -> None:
    wire, server = bench
    with opened(wire, server) as port:
        raw = bytes.fromhex("00c20100000208")  # PSTN 1.2, table 17: 115200, 1, even, 8
        port.client.control_out(_CLASS_TO_INTERFACE, SET_LINE_CODING, 0, 0, raw)
        assert wire.device.line_coding == LineCoding(115200, stop_bits=0, parity=2, data_bits=8)
        assert port.client.control_in(_CLASS_TO_INTERFACE, GET_LINE_CODING, 0, 0, 7) == raw
        for refused in ((SET_LINE_CODING, raw[:-1]), (0x23, b"")):  # and SEND_BREAK
            with pytest.raises(Stall):
                port.client.control_out(_CLASS_TO_INTERFACE, refused[0], 0, 0, refused[1])


def test_descriptors_of_an_abstract_control_model() -> None:
    raw = configuration()
    assert int.from_bytes(raw[2:4], "little") == len(raw)
    assert descriptors.interfaces(raw) == ((2, 2, 1), (10, 0, 0))
    assert descriptors.endpoints(raw) == {NOTIFICATIONS, DATA_IN, DATA_OUT}
    functional = [fields for kind, fields in descriptors.split(raw) if kind == 0x24]
    assert [fields[0] for fields in functional] == [0, 1, 2, 6]  # CDC 1.1, 5.2.3
    assert functional[-1][1:] == bytes([0, 1])  # union of both interfaces


def test_nothing_is_left_behind() -> None:
    with (
        nothing_left_behind(),
        AcmWire([newport()]) as wire,
        UsbIpServer({"1-1": wire.device}) as server,
        opened(wire, server) as port,
    ):
        port.write(b"1VE\r\n")
        port.read(1)
        wire.close()
        wire.close()
