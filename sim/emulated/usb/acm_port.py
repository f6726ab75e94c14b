"""Emulated USB serial port of class CDC-ACM, with a stage controller behind it; for cdc_acm.

Source of descriptors and requests: USB Class Definitions for Communication Devices 1.1 and its
Subclass for PSTN Devices 1.2. Transcript: two interfaces and three endpoints as in Linux's own
gadget (f_acm), at full speed as stage controllers with such a port. Not verified on a device:
bytes sent while no program has the port open (DTR off) are dropped here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from queue import SimpleQueue
from struct import Struct
from typing import NamedTuple

from sim.emulated.usb import descriptors, usbip
from sim.emulated.usb.descriptors import BULK, CS_INTERFACE, IN, INTERRUPT, DeviceIdentity
from sim.emulated.usb.device import Setup, Stall, UsbDevice
from sim.emulated.wire import Controller, Wire

NOTIFICATIONS, DATA_IN, DATA_OUT = IN | 1, IN | 2, 2  # endpoints
SET_LINE_CODING, GET_LINE_CODING, SET_CONTROL_LINE_STATE = 0x20, 0x21, 0x22
_CONTROL_INTERFACE, _DATA_INTERFACE = 0, 1
_COMMUNICATION, _DATA_CLASS, _ABSTRACT_CONTROL, _AT_COMMANDS = 0x02, 0x0A, 0x02, 0x01
_CDC_1_1 = 0x0110
_HEADER, _CALL_MANAGEMENT, _ACM, _UNION = 0, 1, 2, 6  # functional descriptors
_HAS_LINE_CODING = 0x02  # bmCapabilities of ACM: the three requests above
_DATA_TERMINAL_READY = 0x01
_LINE_CODING = Struct("<IBBB")
_PRODUCT_ID = 0x0002


class LineCoding(NamedTuple):
    """Parameters of the line (dwDTERate, bCharFormat, bParityType, bDataBits).

    stop_bits: 0 for 1, 1 for 1.5, 2 for 2. parity: 0 none, 1 odd, 2 even.
    """

    baudrate: int = 9600
    stop_bits: int = 0
    parity: int = 0
    data_bits: int = 8


class AcmPort(UsbDevice):
    """Serial port as a USB device. `received(data)` is called with the computer's bytes.

    `line_coding`: parameters that the computer has set. `open`: True while a program has the port
    open, by the DTR line.
    """

    def __init__(self, identity: DeviceIdentity, received: Callable[[bytes], None]) -> None:
        super().__init__(identity, configuration(), usbip.FULL_SPEED)
        self._received = received
        self.line_coding = LineCoding()
        self.open = False

    def send(self, data: bytes) -> None:
        """Send bytes to the program that has the port open; without one they are dropped."""
        cable = self.cable
        if cable is not None:
            cable.send(DATA_IN, data, lambda: self.open)

    def unplug(self) -> None:
        """Power down."""
        self.open = False
        super().unplug()

    def receive(self, endpoint: int, data: bytes) -> None:
        """Take bytes that a program has written to the port."""
        if endpoint == DATA_OUT and data:
            self._received(data)

    def class_request(self, setup: Setup, data: bytes) -> bytes:
        """Carry out a request of the class."""
        if setup.request == SET_LINE_CODING and len(data) == _LINE_CODING.size:
            self.line_coding = LineCoding(*_LINE_CODING.unpack(data))
            return b""
        if setup.request == GET_LINE_CODING:
            return _LINE_CODING.pack(*self.line_coding)
        if setup.request == SET_CONTROL_LINE_STATE:
            self.open = bool(setup.value & _DATA_TERMINAL_READY)
            if self.cable is not None:
                self.cable.wake()
            return b""
        raise Stall


class AcmWire(Wire):
    """Controllers behind a USB serial port; `device` is what a `UsbIpServer` exports."""

    def __init__(
        self,
        controllers: Sequence[Controller],
        product: str = "Goniometer stage",
        serial: str = "42",
        manufacturer: str = "Emulated Mechanics",
    ) -> None:
        self._arrived: SimpleQueue[bytes] = SimpleQueue()  # b"" ends the thread
        identity = DeviceIdentity(manufacturer, product, serial, _PRODUCT_ID)
        self.device = AcmPort(identity, self._arrived.put)
        super().__init__(controllers)

    def _serve(self) -> None:
        while data := self._arrived.get():
            self._receive(data)

    def _send(self, data: bytes) -> None:
        self.device.send(data)

    def _unplug(self) -> None:
        cable = self.device.cable
        if cable is not None:
            cable.pull()
        if self._closing.is_set():
            self._arrived.put(b"")


def configuration() -> bytes:
    """Return all descriptors of a serial port."""

    def functional(subtype: int, form: str, *fields: int) -> bytes:
        return descriptors.descriptor(CS_INTERFACE, "B" + form, subtype, *fields)

    def bulk(address: int) -> bytes:
        return descriptors.endpoint(bEndpointAddress=address, bmAttributes=BULK, wMaxPacketSize=64)

    return descriptors.configuration(
        descriptors.interface_association(
            bFirstInterface=_CONTROL_INTERFACE,
            bInterfaceCount=2,
            function=(_COMMUNICATION, _ABSTRACT_CONTROL, _AT_COMMANDS),
        ),
        descriptors.interface(
            bInterfaceNumber=_CONTROL_INTERFACE,
            bNumEndpoints=1,
            kind=(_COMMUNICATION, _ABSTRACT_CONTROL, _AT_COMMANDS),
        ),
        functional(_HEADER, "H", _CDC_1_1),
        functional(_CALL_MANAGEMENT, "BB", 0, _DATA_INTERFACE),
        functional(_ACM, "B", _HAS_LINE_CODING),
        functional(_UNION, "BB", _CONTROL_INTERFACE, _DATA_INTERFACE),
        descriptors.endpoint(
            bEndpointAddress=NOTIFICATIONS, bmAttributes=INTERRUPT, wMaxPacketSize=10, bInterval=32
        ),
        descriptors.interface(
            bInterfaceNumber=_DATA_INTERFACE, bNumEndpoints=2, kind=(_DATA_CLASS, 0, 0)
        ),
        bulk(DATA_IN),
        bulk(DATA_OUT),
        bNumInterfaces=2,
    )
