"""Standard requests of USB 2.0, chapter 9, in the order in which Linux enumerates a device."""

from __future__ import annotations

import contextlib
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.emulated.usb import descriptors
from sim.emulated.usb.acm_port import AcmPort, AcmWire
from sim.emulated.usb.descriptors import DeviceIdentity
from sim.emulated.usb.device import Setup, Stall, UsbDevice
from sim.emulated.usb.uvc_camera import UvcCamera
from sim.emulated.v4l2.device import EmulatedCamera
from tests.support.usb.cameras import render

IN = 0x80
IDENTITY = DeviceIdentity("Maker", "Port", "1", 0x0002)


@pytest.fixture(params=["camera", "serial port"])
def device(request: pytest.FixtureRequest) -> UsbDevice:
    if request.param == "camera":
        return UvcCamera(EmulatedCamera(render))
    with AcmWire([]) as wire:
        return wire.device


def ask(device: UsbDevice, kind: int, request: int, value: int, index: int, length: int) -> bytes:
    return device.control(Setup(kind, request, value, index, length), b"")


def test_enumeration(device: UsbDevice) -> None:
    def described(kind: int, length: int, index: int = 0) -> bytes:
        return ask(device, IN, 6, kind << 8 | index, 0x0409 if index else 0, length)

    assert described(descriptors.DEVICE, 8) == described(descriptors.DEVICE, 64)[:8]
    assert len(described(descriptors.DEVICE, 64)) == 18
    head = described(descriptors.CONFIGURATION, 9)
    total = int.from_bytes(head[2:4], "little")
    whole = described(descriptors.CONFIGURATION, total)
    assert whole == described(descriptors.CONFIGURATION, 65535)
    assert len(whole) == total
    assert described(descriptors.STRING, 255) == bytes.fromhex("04030904")  # English
    own = device.identity
    for index, text in enumerate((own.manufacturer, own.product, own.serial), 1):
        assert described(descriptors.STRING, 255, index)[2:].decode("utf-16-le") == text
    ask(device, 0, 9, whole[5], 0, 0)
    assert ask(device, IN, 8, 0, 0, 1) == whole[5:6]
    assert ask(device, IN, 0, 0, 0, 2) == b"\0\0"
    for number in range(whole[4]):
        ask(device, 1, 11, 0, number, 0)
        assert ask(device, IN | 1, 10, 0, number, 1) == b"\0"
    for address in device.endpoints:
        assert ask(device, IN | 2, 0, 0, address, 2) == b"\0\0"


@pytest.mark.parametrize(
    ("kind", "request_number", "value", "index"),
    [
        (IN, 6, 6 << 8, 0),  # device qualifier
        (IN, 6, 15 << 8, 0),  # BOS
        (IN, 6, 2 << 8 | 1, 0),  # a second configuration
        (IN, 6, 3 << 8 | 4, 0),  # a fourth string
        (0, 9, 2, 0),  # a second configuration
        (1, 11, 1, 0),  # an alternate setting
        (1, 11, 0, 7),  # an interface that does not exist
        (2, 1, 0, 0x8F),  # an endpoint that does not exist
        (0, 3, 1, 0),  # remote wake-up
        (IN, 12, 0, 0),  # SYNCH_FRAME
        (IN | 0x40, 1, 0, 0),  # a vendor's request
        (IN | 0x21, 0x77, 0, 0),  # a request unknown to the class
    ],
)
def test_everything_else_stalls(
    device: UsbDevice, kind: int, request_number: int, value: int, index: int
) -> None:
    with pytest.raises(Stall):
        ask(device, kind, request_number, value, index, 64)


@settings(max_examples=200)
@given(
    st.builds(Setup, *[st.integers(0, 255)] * 2, *[st.integers(0, 65535)] * 3),
    st.sampled_from((0x21, 0x22, 0xA1, 0x00, 0x80, 0x81, 0x02)),
    st.integers(0, 0x0B),
    st.integers(0, 3),
    st.binary(max_size=40),
)
def test_any_request_is_answered_or_stalls(
    setup: Setup, kind: int, selector: int, entity: int, data: bytes
) -> None:
    """Drawn at random, and near to requests that exist."""
    near = replace(setup, request_type=kind, value=selector << 8, index=entity << 8)
    for device in (UvcCamera(EmulatedCamera(render)), AcmPort(IDENTITY, lambda _: None)):
        for one in (setup, near, replace(near, index=1), replace(near, index=0x81)):
            with contextlib.suppress(Stall):
                assert len(device.control(one, data)) <= one.length
        device.unplug()


def test_setup_packets_by_the_table() -> None:
    """USB 2.0, table 9-2, and GET_DESCRIPTOR of a device."""
    raw = bytes.fromhex("8006000100001200")
    setup = Setup.parse(raw)
    assert setup == Setup(0x80, 6, 0x0100, 0, 18)
    assert setup.pack() == raw
    assert Setup(0x21, 1, 0x0400, 0x0100, 4).kind == 1
    assert Setup(0x21, 1, 0x0400, 0x0100, 4).recipient == 1
