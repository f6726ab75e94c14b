"""USB/IP messages, version 1.1.1: layouts, packing and parsing in both directions.

Source: Linux, Documentation/usb/usbip_protocol.rst; names of fields are those of the document.
Import-light: the guest computer uses it too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from struct import Struct
from typing import NamedTuple

VERSION = 0x0111
_REQ_DEVLIST, _REP_DEVLIST = 0x8005, 0x0005
_REQ_IMPORT, _REP_IMPORT = 0x8003, 0x0003
_CMD_SUBMIT, _CMD_UNLINK, _RET_SUBMIT, _RET_UNLINK = 1, 2, 3, 4
# start_frame and number_of_packets of a transfer that is not isochronous, as in the document's
# captured example; its table has them the other way round.
_NOT_ISOCHRONOUS = (-1, 0)
OUT, IN = 0, 1
PORT = 3240  # assigned to USB/IP by IANA
LOW_SPEED, FULL_SPEED, HIGH_SPEED, SUPER_SPEED = 1, 2, 3, 5  # enum usb_device_speed of Linux

_OPERATION = Struct(">HHI")  # version, code, status
_COUNT = Struct(">I")
_BUSID = Struct(">32s")
# path, busid, busnum, devnum, speed, idVendor, idProduct, bcdDevice, bDeviceClass, bDeviceSubClass,
# bDeviceProtocol, bConfigurationValue, bNumConfigurations, bNumInterfaces
_DEVICE = Struct(">256s32sIIIHHHBBBBBB")
_INTERFACE = Struct(">BBBx")  # class, subclass, protocol
# command, seqnum, devid, direction, ep, transfer_flags, transfer_buffer_length, start_frame,
# number_of_packets, interval, setup
_SUBMIT = Struct(">IIIIIIiiii8s")
_UNLINK = Struct(">IIIIII24x")  # command, seqnum, devid, direction, ep, unlink_seqnum
# command, seqnum, devid, direction, ep, status, actual_length, start_frame, number_of_packets,
# error_count
_RET_SUBMIT_STRUCT = Struct(">IIIIIiiiii8x")
_RET_UNLINK_STRUCT = Struct(">IIIIIi24x")  # command, seqnum, devid, direction, ep, status
_HEADER_BYTES = 48

Read = Callable[[int], bytes]  # returns exactly so many bytes, or raises EOFError


def exactly(receive: Callable[[int], bytes]) -> Read:
    """Return a `Read` over a socket's `recv`, which may return fewer bytes."""

    def read(count: int) -> bytes:
        pieces = bytearray()
        while len(pieces) < count:
            piece = receive(count - len(pieces))
            if not piece:
                raise EOFError("the other end has closed the USB/IP connection")
            pieces += piece
        return bytes(pieces)

    return read


class ProtocolError(Exception):
    """Message that the USB/IP protocol does not allow at this place."""


class ExportedDevice(NamedTuple):
    """Device as a server describes it; `interfaces` are (class, subclass, protocol) of each."""

    path: str
    busid: str
    busnum: int
    devnum: int
    speed: int
    id_vendor: int
    id_product: int
    bcd_device: int
    device_class: int
    device_subclass: int
    device_protocol: int
    configuration_value: int
    configurations: int
    interfaces: tuple[tuple[int, int, int], ...]

    @property
    def devid(self) -> int:
        """Number of the device in requests."""
        return self.busnum << 16 | self.devnum


class Submit(NamedTuple):
    """Command to carry out one transfer (USBIP_CMD_SUBMIT); `data` is empty for IN."""

    seqnum: int
    devid: int
    direction: int
    ep: int
    length: int
    setup: bytes = bytes(8)
    data: bytes = b""
    transfer_flags: int = 0
    interval: int = 0


class Unlink(NamedTuple):
    """Command to withdraw a transfer (USBIP_CMD_UNLINK)."""

    seqnum: int
    devid: int
    unlink_seqnum: int


class Submitted(NamedTuple):
    """Completion of a transfer (USBIP_RET_SUBMIT); `data` is empty for OUT."""

    seqnum: int
    status: int
    actual_length: int
    data: bytes = b""


class Unlinked(NamedTuple):
    """Answer to an unlink (USBIP_RET_UNLINK): -ECONNRESET, or 0 where the transfer was complete."""

    seqnum: int
    status: int


# Operations before a device is imported


def pack_list_request() -> bytes:
    """Return OP_REQ_DEVLIST."""
    return _OPERATION.pack(VERSION, _REQ_DEVLIST, 0)


def pack_import_request(busid: str) -> bytes:
    """Return OP_REQ_IMPORT."""
    return _OPERATION.pack(VERSION, _REQ_IMPORT, 0) + _BUSID.pack(_text(busid, _BUSID.size))


def read_request(read: Read) -> str | None:
    """Return the busid of an OP_REQ_IMPORT; None for OP_REQ_DEVLIST."""
    version, code, _ = _OPERATION.unpack(read(_OPERATION.size))
    if version != VERSION or code not in (_REQ_DEVLIST, _REQ_IMPORT):
        raise ProtocolError(f"request {code:#06x} of version {version:#06x}")
    return _from_text(read(_BUSID.size)) if code == _REQ_IMPORT else None


def pack_list_reply(devices: Sequence[ExportedDevice]) -> bytes:
    """Return OP_REP_DEVLIST."""
    head = _OPERATION.pack(VERSION, _REP_DEVLIST, 0) + _COUNT.pack(len(devices))
    return head + b"".join(
        _pack_device(device) + b"".join(_INTERFACE.pack(*each) for each in device.interfaces)
        for device in devices
    )


def read_list_reply(read: Read) -> list[ExportedDevice]:
    """Return the devices of an OP_REP_DEVLIST."""
    _check_reply(read, _REP_DEVLIST)
    (count,) = _COUNT.unpack(read(_COUNT.size))
    devices = []
    for _ in range(count):
        device, interfaces = _read_device(read)
        found = [_INTERFACE.unpack(read(_INTERFACE.size)) for _ in range(interfaces)]
        devices.append(device._replace(interfaces=tuple(found)))
    return devices


def pack_import_reply(device: ExportedDevice | None) -> bytes:
    """Return OP_REP_IMPORT; None for a device that is unknown or already imported."""
    head = _OPERATION.pack(VERSION, _REP_IMPORT, 0 if device else 1)
    return head + (_pack_device(device) if device else b"")


def read_import_reply(read: Read) -> ExportedDevice:
    """Return the device of an OP_REP_IMPORT, without its interfaces."""
    _check_reply(read, _REP_IMPORT)
    return _read_device(read)[0]


def _check_reply(read: Read, expected: int) -> None:
    version, code, status = _OPERATION.unpack(read(_OPERATION.size))
    if (version, code) != (VERSION, expected):
        raise ProtocolError(f"reply {code:#06x} of version {version:#06x}, not {expected:#06x}")
    if status:
        raise ProtocolError(f"refused with status {status}: no such device, or it is imported")


def _pack_device(device: ExportedDevice) -> bytes:
    path, busid = _text(device.path, 256), _text(device.busid, _BUSID.size)
    return _DEVICE.pack(path, busid, *device[2:-1], len(device.interfaces))


def _read_device(read: Read) -> tuple[ExportedDevice, int]:
    """Return a device without its interfaces, and their number."""
    path, busid, *numbers, interfaces = _DEVICE.unpack(read(_DEVICE.size))
    fields = (_from_text(path), _from_text(busid), *numbers, ())
    return ExportedDevice._make(fields), interfaces


def _text(text: str, size: int) -> bytes:
    raw = text.encode()
    if len(raw) >= size:
        raise ValueError(f"{text!r} has {len(raw)} bytes: at most {size - 1} fit into the message")
    return raw


def _from_text(raw: bytes) -> str:
    return raw.split(b"\0", 1)[0].decode("utf-8", "replace")


# Transfers of an imported device


def pack_command(command: Submit | Unlink) -> bytes:
    """Return USBIP_CMD_SUBMIT or USBIP_CMD_UNLINK."""
    if isinstance(command, Unlink):
        seqnum, devid, unlinked = command
        return _UNLINK.pack(_CMD_UNLINK, seqnum, devid, 0, 0, unlinked)
    seqnum, devid, direction, ep, length, setup, data, flags, interval = command
    header = (_CMD_SUBMIT, seqnum, devid, direction, ep)
    return _SUBMIT.pack(*header, flags, length, *_NOT_ISOCHRONOUS, interval, setup) + data


def read_command(read: Read) -> Submit | Unlink:
    """Return the next command of the importing computer."""
    header = read(_HEADER_BYTES)
    command, seqnum, devid, direction, ep, *_ = _UNLINK.unpack(header)
    if command == _CMD_UNLINK:
        return Unlink(seqnum, devid, _UNLINK.unpack(header)[5])
    if command != _CMD_SUBMIT:
        raise ProtocolError(f"command {command:#x}")
    flags, length, _, packets, interval, setup = _SUBMIT.unpack(header)[5:]
    if length < 0 or packets > 0:
        raise ProtocolError(f"transfer of {length} bytes in {packets} isochronous packets")
    data = read(length) if direction == OUT else b""
    return Submit(seqnum, devid, direction, ep, length, setup, data, flags, interval)


def pack_reply(reply: Submitted | Unlinked) -> bytes:
    """Return USBIP_RET_SUBMIT or USBIP_RET_UNLINK."""
    if isinstance(reply, Unlinked):
        return _RET_UNLINK_STRUCT.pack(_RET_UNLINK, reply.seqnum, 0, 0, 0, reply.status)
    seqnum, status, length, data = reply
    counts = (status, length, *_NOT_ISOCHRONOUS, 0)
    return _RET_SUBMIT_STRUCT.pack(_RET_SUBMIT, seqnum, 0, 0, 0, *counts) + data


def read_reply(read: Read, is_in: Callable[[int], bool]) -> Submitted | Unlinked:
    """Return the next reply of the server; `is_in(seqnum)` tells transfers that carry data."""
    header = read(_HEADER_BYTES)
    command, seqnum, _, _, _, status = _RET_UNLINK_STRUCT.unpack(header)
    if command == _RET_UNLINK:
        return Unlinked(seqnum, status)
    if command != _RET_SUBMIT:
        raise ProtocolError(f"reply {command:#x}")
    length = _RET_SUBMIT_STRUCT.unpack(header)[6]
    return Submitted(seqnum, status, length, read(length) if is_in(seqnum) else b"")
