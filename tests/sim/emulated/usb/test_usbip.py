"""USB/IP messages, against the kernel's document and in both directions."""

from __future__ import annotations

import io
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.emulated.usb import usbip
from sim.emulated.usb.usbip import (
    ExportedDevice,
    ProtocolError,
    Submit,
    Submitted,
    Unlink,
    Unlinked,
)

# The example at the end of Linux's Documentation/usb/usbip_protocol.rst, captured from a HID.
CMD_IN = (
    "00000001 00000d05 0001000f 00000001 00000001 00000200 00000040 ffffffff 00000000 00000004"
    "00000000 00000000"
)
CMD_OUT = (
    "00000001 00000d06 0001000f 00000000 00000001 00000000 00000040 ffffffff 00000000 00000004"
    "00000000 00000000"
)
OUT_DATA = bytes.fromhex("ffffffff860008a784ce5ae2123763").ljust(64, b"\0")
RET_OUT = (
    "00000003 00000d06 00000000 00000000 00000000 00000000 00000040 ffffffff 00000000 00000000"
    "00000000 00000000"
)
RET_IN = (
    "00000003 00000d05 00000000 00000000 00000000 00000000 00000040 ffffffff 00000000 00000000"
    "00000000 00000000"
)
IN_DATA = bytes.fromhex("ffffffff860011a784ce5ae2123763612891b10201000004").ljust(64, b"\0")

DOCUMENTED = [
    (Submit(0xD05, 0x1000F, usbip.IN, 1, 64, transfer_flags=0x200, interval=4), CMD_IN, b""),
    (Submit(0xD06, 0x1000F, usbip.OUT, 1, 64, data=OUT_DATA, interval=4), CMD_OUT, OUT_DATA),
    (Submitted(0xD06, 0, 64), RET_OUT, b""),
    (Submitted(0xD05, 0, 64, IN_DATA), RET_IN, IN_DATA),
]

UINT32, INT32 = st.integers(0, 2**32 - 1), st.integers(-(2**31), 2**31 - 1)
BYTE, UINT16 = st.integers(0, 255), st.integers(0, 65535)
DATA = st.binary(max_size=100)
SETUP = st.binary(min_size=8, max_size=8)


def text(most: int) -> st.SearchStrategy[str]:
    return st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=most)


DEVICES = st.builds(
    ExportedDevice,
    text(255),
    text(31),
    UINT32,
    UINT32,
    UINT32,
    UINT16,
    UINT16,
    UINT16,
    *[BYTE] * 5,
    st.lists(st.tuples(BYTE, BYTE, BYTE), max_size=5).map(tuple),
)


def reader(*messages: bytes) -> usbip.Read:
    """Read as from a connection that delivers at most 7 bytes at a time."""
    stream = io.BytesIO(b"".join(messages))
    return usbip.exactly(lambda count: stream.read(min(count, 7)))


@pytest.mark.parametrize(("message", "header", "data"), DOCUMENTED)
def test_the_messages_of_the_document(
    message: Submit | Submitted, header: str, data: bytes
) -> None:
    raw = bytes.fromhex(header) + data
    if isinstance(message, Submit):
        assert usbip.pack_command(message) == raw
        assert usbip.read_command(reader(raw)) == message
    else:
        assert usbip.pack_reply(message) == raw
        assert usbip.read_reply(reader(raw), lambda seqnum: seqnum == 0xD05) == message


def test_both_forms_of_a_transfer_that_is_not_isochronous() -> None:
    """The table has number_of_packets 0xffffffff, the capture 0; a positive number is refused."""
    start = bytes.fromhex(CMD_IN)
    for packets in (0, -1):
        raw = start[:32] + packets.to_bytes(4, "big", signed=True) + start[36:]
        assert usbip.read_command(reader(raw)) == DOCUMENTED[0][0]
    with pytest.raises(ProtocolError, match="8 isochronous"):
        usbip.read_command(reader(start[:32] + (8).to_bytes(4, "big") + start[36:]))


def test_operations_as_in_the_tables() -> None:
    assert usbip.pack_list_request().hex() == "0111800500000000"
    assert usbip.pack_import_request("3-2").hex() == "0111800300000000" + "332d32" + 29 * "00"
    assert usbip.pack_import_reply(None).hex() == "0111000300000001"
    device = ExportedDevice(
        "/sys/devices/x", "3-2", 3, 2, 3, 0x1209, 1, 0x100, 0xEF, 2, 1, 1, 1, ((14, 1, 0),)
    )
    listed = usbip.pack_list_reply([device])
    assert listed[:12].hex() == "011100050000000000000001"
    body = listed[12:]
    assert body[:256].rstrip(b"\0") == b"/sys/devices/x"
    assert body[256:288].rstrip(b"\0") == b"3-2"
    numbers = "00000003 00000002 00000003 1209 0001 0100 ef 02 01 01 01 01 0e 01 00 00"
    assert body[288:] == bytes.fromhex(numbers)
    assert usbip.pack_import_reply(device) == bytes.fromhex("0111000300000000") + body[:-4]
    assert device.devid == 0x30002


@given(st.lists(DEVICES, max_size=3))
def test_lists_of_devices_round_trip(devices: list[ExportedDevice]) -> None:
    assert usbip.read_list_reply(reader(usbip.pack_list_reply(devices))) == devices


@given(DEVICES)
def test_imports_round_trip(device: ExportedDevice) -> None:
    found = usbip.read_import_reply(reader(usbip.pack_import_reply(device)))
    assert found == device._replace(interfaces=())
    assert usbip.read_request(reader(usbip.pack_import_request(device.busid))) == device.busid


@given(
    st.builds(Submit, UINT32, UINT32, st.just(0), BYTE, st.just(0), SETUP, DATA, UINT32, INT32),
    st.integers(0, 2**31 - 1),
    st.builds(Unlink, UINT32, UINT32, UINT32),
)
def test_commands_round_trip(out: Submit, length: int, unlink: Unlink) -> None:
    out = out._replace(length=len(out.data))
    into = out._replace(direction=usbip.IN, length=length, data=b"")
    read = reader(*map(usbip.pack_command, (out, into, unlink)))
    assert [usbip.read_command(read) for _ in range(3)] == [out, into, unlink]


@given(UINT32, INT32, DATA, st.integers(0, 2**31 - 1))
def test_replies_round_trip(seqnum: int, status: int, data: bytes, length: int) -> None:
    into, out = Submitted(seqnum, status, len(data), data), Submitted(seqnum, status, length)
    unlinked = Unlinked(seqnum, status)
    read = reader(*map(usbip.pack_reply, (into, out, unlinked)))
    carries = iter((True, False))
    found = [usbip.read_reply(read, lambda _: next(carries)) for _ in range(3)]
    assert found == [into, out, unlinked]


@pytest.mark.parametrize(
    ("read", "message"),
    [
        (usbip.read_request, "0100800500000000"),  # version 1.0
        (usbip.read_request, "0111800700000000"),  # unknown request
        (usbip.read_list_reply, "0111000300000000"),  # reply to something else
        (usbip.read_import_reply, "0111000300000001"),  # refused
        (usbip.read_command, "00000003" + 44 * "00"),  # a reply where a command is due
    ],
)
def test_other_messages_are_refused(read: Callable[[usbip.Read], object], message: str) -> None:
    with pytest.raises(ProtocolError):
        read(reader(bytes.fromhex(message)))


def test_a_message_that_breaks_off_ends_the_connection() -> None:
    raw = usbip.pack_command(Unlink(1, 2, 3))
    with pytest.raises(EOFError):
        usbip.read_command(reader(raw[:-1]))
    with pytest.raises(ValueError, match="at most 31 fit"):
        usbip.pack_import_request(32 * "1")
