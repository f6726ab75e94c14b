"""AZ drive framing against the maker's example, and settings that are refused."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.framer import FramerRTU
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.register_message import WriteMultipleRegistersRequest

from drivers.stages.oriental_framing import (
    Output,
    alarm_text,
    degrees_of,
    direct_data_of,
    move_block,
    output_of,
    steps_of,
    value_of,
    words_of,
)
from instrument.errors import DeviceError
from tests.support.stages.emulated_az_drive import MAKERS_EXAMPLE


def test_a_move_has_the_bytes_of_the_makers_example() -> None:
    block = list(move_block(8500, 2000, 1500))
    request = WriteMultipleRegistersRequest(address=0x58, registers=block, count=16, dev_id=1)
    assert FramerRTU(DecodePDU(True)).buildFrame(request) == MAKERS_EXAMPLE


@given(st.integers(-(2**31), 2**31 - 1))
def test_32_bit_values_survive_two_registers(value: int) -> None:
    words = words_of(value)
    assert value_of(words) == value
    assert b"".join(w.to_bytes(2, "big") for w in words) == value.to_bytes(4, "big", signed=True)


@pytest.mark.parametrize("value", [2**31, -(2**31) - 1])
def test_a_value_beyond_32_bits_is_refused(value: int) -> None:
    with pytest.raises(DeviceError, match=str(value)):
        words_of(value)


@given(st.floats(-400, 400), st.floats(0.5, 1e6))
def test_degrees_are_kept_to_half_a_step(angle: float, scale: float) -> None:
    steps = steps_of(angle, scale)
    back = degrees_of(steps, scale)
    assert abs(back - angle) <= 0.5 / scale + 1e-12
    assert steps_of(back, scale) == steps


@given(st.tuples(*[st.integers(-(2**31), 2**31 - 1)] * 3))
def test_a_move_block_contains_its_parameters(parts: tuple[int, int, int]) -> None:
    data = direct_data_of(move_block(*parts))
    assert (data.number, data.kind, data.trigger) == (0, 1, 1)
    assert (data.position, data.current) == (parts[0], 1000)
    assert data.speed_hz == max(parts[1], 1)
    assert data.acceleration == data.deceleration == max(parts[2], 1)


def test_angles_beyond_the_step_counter_are_refused() -> None:
    with pytest.raises(DeviceError, match=r"1e\+12 steps per degree"):
        steps_of(170.0, 1e12)


@pytest.mark.parametrize(
    ("code", "says"),
    [(0x30, "overload"), (0x66, "hardware overtravel"), (0x67, "software overtravel")],
)
def test_alarms_are_named(code: int, says: str) -> None:
    assert f"alarm {code:02X}h ({says}): " in alarm_text(code)


def test_an_unknown_alarm_is_quoted_in_hex() -> None:
    assert "alarm 2Fh (not known here)" in alarm_text(0x2F)
    assert "alarm 00h" in Output(word=1 << 7, alarm=0).fault  # the bit alone is an alarm too
    assert output_of([0, 0x4030, 0, 0]) == Output(0x4030, 0)
