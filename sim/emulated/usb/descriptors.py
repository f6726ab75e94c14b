"""USB 2.0 descriptors by the names of their fields (chapter 9.6, and the ECN on associations)."""

from __future__ import annotations

from collections.abc import Iterator
from struct import pack
from typing import NamedTuple

DEVICE, CONFIGURATION, STRING, INTERFACE, ENDPOINT = 1, 2, 3, 4, 5
INTERFACE_ASSOCIATION = 11
CS_INTERFACE = 0x24  # class-specific
BULK, INTERRUPT = 2, 3  # bmAttributes of an endpoint
IN = 0x80  # bit of bEndpointAddress
# bDeviceClass, bDeviceSubClass, bDeviceProtocol of a device with an interface association (USB ECN)
MISCELLANEOUS = (0xEF, 0x02, 0x01)
_ENGLISH = 0x0409
_BUS_POWERED = 0x80  # bit of bmAttributes of a configuration, always set
_USB_2 = 0x0200


class DeviceIdentity(NamedTuple):
    """Numbers and names by which a computer recognises a device.

    The vendor id 0x1209 is that of pid.codes, which sets the product ids 0x0001 to 0x0010 aside
    for tests (pid.codes/1209/0001).
    """

    manufacturer: str
    product: str
    serial: str
    id_product: int
    id_vendor: int = 0x1209
    bcd_device: int = 0x0100


def descriptor(bDescriptorType: int, form: str, *fields: object) -> bytes:
    """Return a descriptor; `form` is the `struct` format of the fields after bDescriptorType."""
    body = pack("<" + form, *fields)
    return bytes([2 + len(body), bDescriptorType]) + body


def device(identity: DeviceIdentity, bMaxPacketSize0: int = 64) -> bytes:
    """Return the device descriptor; its strings have the indices 1 to 3."""
    ids = (identity.id_vendor, identity.id_product, identity.bcd_device)
    return descriptor(
        DEVICE, "HBBBBHHHBBBB", _USB_2, *MISCELLANEOUS, bMaxPacketSize0, *ids, 1, 2, 3, 1
    )


def configuration(*parts: bytes, bNumInterfaces: int, milliamperes: int = 100) -> bytes:
    """Return the only configuration with all descriptors that belong to it."""
    body = b"".join(parts)
    fields = (9 + len(body), bNumInterfaces, 1, 0, _BUS_POWERED, milliamperes // 2)
    return descriptor(CONFIGURATION, "HBBBBB", *fields) + body


def interface_association(
    *,
    bFirstInterface: int,
    bInterfaceCount: int,
    function: tuple[int, int, int],
    iFunction: int = 0,
) -> bytes:
    """Return the descriptor that joins interfaces to one function."""
    fields = (bFirstInterface, bInterfaceCount, *function, iFunction)
    return descriptor(INTERFACE_ASSOCIATION, "6B", *fields)


def interface(
    *, bInterfaceNumber: int, bNumEndpoints: int, kind: tuple[int, int, int], iInterface: int = 0
) -> bytes:
    """Return an interface descriptor; `kind` is its class, subclass and protocol."""
    fields = (bInterfaceNumber, 0, bNumEndpoints, *kind, iInterface)
    return descriptor(INTERFACE, "7B", *fields)


def endpoint(
    *, bEndpointAddress: int, bmAttributes: int, wMaxPacketSize: int, bInterval: int = 0
) -> bytes:
    """Return an endpoint descriptor."""
    return descriptor(ENDPOINT, "BBHB", bEndpointAddress, bmAttributes, wMaxPacketSize, bInterval)


def string(text: str) -> bytes:
    """Return a string descriptor."""
    return descriptor(STRING, f"{2 * len(text)}s", text.encode("utf-16-le"))


def languages() -> bytes:
    """Return the string descriptor of index 0: the languages of the strings."""
    return descriptor(STRING, "H", _ENGLISH)


def split(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield type and fields of each descriptor in a row of them."""
    while data:
        length = data[0]
        if not 2 <= length <= len(data):
            raise ValueError(f"descriptor of {length} bytes where {len(data)} are left")
        yield data[1], data[2:length]
        data = data[length:]


def interfaces(configuration_descriptors: bytes) -> tuple[tuple[int, int, int], ...]:
    """Return class, subclass and protocol of each interface of a configuration."""
    found = [f for kind, f in split(configuration_descriptors) if kind == INTERFACE]
    return tuple((fields[3], fields[4], fields[5]) for fields in found)


def endpoints(configuration_descriptors: bytes) -> frozenset[int]:
    """Return the addresses of a configuration's endpoints."""
    return frozenset(f[0] for kind, f in split(configuration_descriptors) if kind == ENDPOINT)
