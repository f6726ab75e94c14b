"""USB descriptors: lengths and totals, and rows of them taken apart again."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.emulated.usb import descriptors
from sim.emulated.usb.descriptors import DeviceIdentity

BYTE = st.integers(0, 255)
KIND = st.tuples(BYTE, BYTE, BYTE)
NAME = st.text(st.characters(codec="ascii", min_codepoint=32), max_size=126)


def test_a_device_descriptor_by_the_table() -> None:
    """USB 2.0, table 9-8."""
    raw = descriptors.device(DeviceIdentity("Maker", "Thing", "7", 0x0002, bcd_device=0x0123))
    assert raw.hex(" ") == "12 01 00 02 ef 02 01 40 09 12 02 00 23 01 01 02 03 01"


def test_an_endpoint_descriptor_by_the_table() -> None:
    """USB 2.0, table 9-13."""
    raw = descriptors.endpoint(
        bEndpointAddress=0x81, bmAttributes=2, wMaxPacketSize=512, bInterval=4
    )
    assert raw.hex(" ") == "07 05 81 02 00 02 04"


@given(st.lists(st.tuples(KIND, st.lists(BYTE, max_size=4)), min_size=1, max_size=6))
def test_a_configuration_counts_what_belongs_to_it(
    parts: list[tuple[tuple[int, int, int], list[int]]],
) -> None:
    raw = descriptors.configuration(
        *[
            descriptors.interface(bInterfaceNumber=i, bNumEndpoints=len(addresses), kind=kind)
            + b"".join(
                descriptors.endpoint(bEndpointAddress=a, bmAttributes=2, wMaxPacketSize=64)
                for a in addresses
            )
            for i, (kind, addresses) in enumerate(parts)
        ],
        bNumInterfaces=len(parts),
    )
    assert int.from_bytes(raw[2:4], "little") == len(raw)
    assert raw[4] == len(parts)
    assert descriptors.interfaces(raw) == tuple(kind for kind, _ in parts)
    assert descriptors.endpoints(raw) == {a for _, addresses in parts for a in addresses}
    kinds = [kind for kind, _ in descriptors.split(raw)]
    assert kinds[0] == descriptors.CONFIGURATION
    assert len(kinds) == 1 + len(parts) + sum(len(addresses) for _, addresses in parts)


@given(NAME)
def test_strings_are_utf_16(text: str) -> None:
    raw = descriptors.string(text)
    assert raw[:2] == bytes([len(raw), descriptors.STRING])
    assert raw[2:].decode("utf-16-le") == text


@pytest.mark.parametrize("raw", ["01", "0905", "070500"])
def test_a_row_that_breaks_off_is_refused(raw: str) -> None:
    with pytest.raises(ValueError, match="are left"):
        list(descriptors.split(bytes.fromhex(raw)))
