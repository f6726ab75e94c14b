"""USB device: standard requests of chapter 9 of USB 2.0; classes of devices add their own.

A device is plugged into a `Cable`, through which it completes the transfers of its IN endpoints.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass
from struct import Struct
from typing import Protocol

from sim.emulated.usb import descriptors
from sim.emulated.usb.descriptors import DeviceIdentity

_SETUP = Struct("<BBHHH")
_STANDARD, _CLASS = 0, 1  # kinds of requests
_TO_INTERFACE, _TO_ENDPOINT = 1, 2  # recipients
_GET_STATUS, _CLEAR_FEATURE, _SET_FEATURE = 0, 1, 3
_GET_DESCRIPTOR, _GET_CONFIGURATION, _SET_CONFIGURATION = 6, 8, 9
_GET_INTERFACE, _SET_INTERFACE = 10, 11
_ENDPOINT_HALT = 0


class Stall(Exception):
    """Request that the device does not accept, or endpoint that is halted."""


@dataclass(frozen=True, slots=True)
class Setup:
    """Setup packet of a control transfer (bmRequestType, bRequest, wValue, wIndex, wLength)."""

    request_type: int
    request: int
    value: int
    index: int
    length: int

    @classmethod
    def parse(cls, raw: bytes) -> Setup:
        """Return the fields of the 8 bytes of a setup packet."""
        return cls(*_SETUP.unpack(raw))

    def pack(self) -> bytes:
        """Return the 8 bytes of the setup packet."""
        return _SETUP.pack(*astuple(self))

    @property
    def kind(self) -> int:
        """Standard (0), class (1) or vendor (2) request."""
        return self.request_type >> 5 & 3

    @property
    def recipient(self) -> int:
        """Device (0), interface (1) or endpoint (2)."""
        return self.request_type & 0x1F


class Cable(Protocol):
    """Connection of a device with the computer that imported it."""

    def send(self, endpoint: int, data: bytes, wanted: Callable[[], bool] = lambda: True) -> bool:
        """Complete transfers of an IN endpoint with these bytes, waiting for the computer's next.

        A transfer that the bytes do not fill ends short. False if the cable was pulled, or if
        `wanted()` became false (see `wake`), before all were sent.
        """

    def awaited(self, endpoint: int) -> bool:
        """Return True if the computer has a transfer ready for an IN endpoint."""

    def wake(self) -> None:
        """Let all who wait in `send` look at their `wanted()` again."""

    def pull(self) -> None:
        """Disconnect the device."""


class UsbDevice:
    """Device with one configuration. Subclasses add class requests and endpoints.

    `configured`: value of the last SET_CONFIGURATION. `halted`: addresses of halted endpoints.
    """

    def __init__(self, identity: DeviceIdentity, configuration: bytes, speed: int) -> None:
        self.identity, self.speed = identity, speed
        self.configuration = configuration
        self.endpoints = descriptors.endpoints(configuration)
        self.cable: Cable | None = None
        self.configured = 0
        self.halted: set[int] = set()

    @property
    def present(self) -> bool:
        """True if a computer can import the device."""
        return True

    def plug(self, cable: Cable) -> None:
        """Power up: a computer has imported the device."""
        self.configured = 0
        self.halted.clear()
        self.cable = cable

    def unplug(self) -> None:
        """Power down: the cable was pulled. Called after its last transfer, also by `pull`."""
        self.cable = None

    def control(self, setup: Setup, data: bytes) -> bytes:
        """Carry out a control transfer; return the bytes for the computer, at most wLength."""
        if setup.kind == _STANDARD:
            answer = self._standard(setup)
        elif setup.kind == _CLASS:
            answer = self.class_request(setup, data)
        else:
            raise Stall
        return answer[: setup.length]

    def class_request(self, setup: Setup, data: bytes) -> bytes:
        """Carry out a request of the device's class."""
        raise Stall(f"{setup} with {len(data)} bytes")

    def receive(self, endpoint: int, data: bytes) -> None:
        """Take the bytes of an OUT endpoint's transfer."""
        raise Stall(f"{len(data)} bytes for endpoint {endpoint:#04x}")

    def stop_endpoint(self, endpoint: int) -> None:
        """End present transfers of an endpoint: its halt was cleared or its interface was set."""

    def _standard(self, setup: Setup) -> bytes:
        handlers: dict[int, Callable[[Setup], bytes]] = {
            _GET_STATUS: self._status,
            _CLEAR_FEATURE: self._clear_feature,
            _SET_FEATURE: self._set_feature,
            _GET_DESCRIPTOR: self._descriptor,
            _GET_CONFIGURATION: lambda _: bytes([self.configured]),
            _SET_CONFIGURATION: self._configure,
            _GET_INTERFACE: lambda _: b"\0",
            _SET_INTERFACE: self._set_interface,
        }
        if setup.request not in handlers:
            raise Stall
        return handlers[setup.request](setup)

    def _descriptor(self, setup: Setup) -> bytes:
        kind, index = setup.value >> 8, setup.value & 0xFF
        if kind == descriptors.DEVICE:
            return descriptors.device(self.identity)
        if kind == descriptors.CONFIGURATION and index == 0:
            return self.configuration
        if kind == descriptors.STRING and index <= 3:
            own = self.identity
            texts = (own.manufacturer, own.product, own.serial)
            return descriptors.string(texts[index - 1]) if index else descriptors.languages()
        raise Stall

    def _configure(self, setup: Setup) -> bytes:
        if setup.value not in (0, 1):
            raise Stall
        self.configured = setup.value
        self._stop_all()
        return b""

    def _set_interface(self, setup: Setup) -> bytes:
        if setup.value != 0 or setup.index >= len(descriptors.interfaces(self.configuration)):
            raise Stall  # no interface has an alternate setting
        self._stop_all()
        return b""

    def _stop_all(self) -> None:
        self.halted.clear()
        for endpoint in self.endpoints:
            self.stop_endpoint(endpoint)

    def _status(self, setup: Setup) -> bytes:
        if setup.recipient == _TO_ENDPOINT:
            return bytes([self._existing(setup.index) in self.halted, 0])
        return bytes(2)  # bus-powered, no remote wake-up

    def _clear_feature(self, setup: Setup) -> bytes:
        endpoint = self._halt_request(setup)
        self.halted.discard(endpoint)
        self.stop_endpoint(endpoint)
        return b""

    def _set_feature(self, setup: Setup) -> bytes:
        endpoint = self._halt_request(setup)
        self.halted.add(endpoint)
        self.stop_endpoint(endpoint)
        return b""

    def _halt_request(self, setup: Setup) -> int:
        """Return the endpoint of a request about ENDPOINT_HALT, the only feature there is."""
        if (setup.recipient, setup.value) != (_TO_ENDPOINT, _ENDPOINT_HALT):
            raise Stall
        return self._existing(setup.index)

    def _existing(self, endpoint: int) -> int:
        if endpoint not in self.endpoints and endpoint & 0x7F:
            raise Stall
        return endpoint
