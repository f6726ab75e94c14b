"""Literal bytes: what an AZ drive is told, and what the emulated one makes of it."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.framer import FramerRTU
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.register_message import WriteMultipleRegistersRequest

from drivers.stages.oriental import OrientalSettings
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
from instrument.clock import SystemClock
from instrument.errors import DeviceError, InputError
from sim.emulated.modbus_tcp_gateway import ModbusTcpGateway
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.oriental_controller import OrientalController, crc
from tests.support.stages.emulated_az_drive import FAST, LIMITS

# The maker's example: direct operation to 8500 steps at 2000 Hz, 1.5 kHz/s.
EXAMPLE = bytes.fromhex(
    "01 10 0058 0010 20 00000000 00000001 00002134 000007D0 000005DC 000005DC 000003E8 00000001E343"
)


def test_a_move_is_the_makers_example_to_the_byte() -> None:
    block = list(move_block(8500, 2000, 1500))
    request = WriteMultipleRegistersRequest(address=0x58, registers=block, count=16, dev_id=1)
    assert FramerRTU(DecodePDU(True)).buildFrame(request) == EXAMPLE


def test_the_emulated_drive_takes_the_makers_example() -> None:
    motor = Motor(replace(FAST, max_deg=180.0), SystemClock())
    drive = OrientalController(motor, steps_per_deg=100.0)
    answer = b"".join(drive.answer(EXAMPLE[i : i + 1]) for i in range(len(EXAMPLE)))
    assert answer == bytes.fromhex("01 10 0058 0010") + crc(bytes.fromhex("01 10 0058 0010"))
    assert drive.triggers == 1
    assert motor.moving


def test_the_check_bytes_are_those_of_the_specification() -> None:
    # "02 07" has CRC 1241 hex, sent low byte first: Modbus over serial line V1.02, 6.2.2
    assert crc(bytes([2, 7])) == bytes([0x41, 0x12])


@given(st.integers(-(2**31), 2**31 - 1))
def test_a_32_bit_value_survives_its_two_registers(value: int) -> None:
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


@given(st.tuples(*[st.integers(-(2**31), 2**31 - 1)] * 3), st.integers(1, 1000))
def test_a_move_block_says_what_was_put_in(parts: tuple[int, int, int], current: int) -> None:
    data = direct_data_of(move_block(*parts, current))
    assert (data.number, data.kind, data.trigger) == (0, 1, 1)
    assert (data.position, data.current) == (parts[0], current)
    assert data.speed_hz == max(parts[1], 1)
    assert data.acceleration == data.deceleration == max(parts[2], 1)


def test_angles_that_no_step_counter_holds_are_refused() -> None:
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


@pytest.mark.parametrize(
    "wrong", [{"steps_per_deg": 0.0}, {"steps_per_deg": 10.0}, {"current": 1001}, {"current": 0}]
)
def test_settings_that_cannot_be_kept_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match=r"0|tolerance_deg|1001"):
        OrientalSettings(**{"port": "x", "steps_per_deg": 100.0, "limits": LIMITS} | wrong)  # type: ignore[arg-type]  # one wrong value at a time


@pytest.mark.parametrize("reset", ["06 0181 0001", "06 007D 0080"])
def test_the_drives_alarm_is_reset_by_either_way(reset: str) -> None:
    drive = OrientalController(Motor(FAST, SystemClock()))
    drive.motor.fail("30")
    drive.serve(bytes.fromhex("06 007D 0010"))
    assert drive.homings == 0  # refused
    assert drive.serve(bytes.fromhex("03 0080 0002"))[2:] == bytes.fromhex("0000 0030")
    drive.serve(bytes.fromhex(reset))
    assert drive.serve(bytes.fromhex("03 0080 0002"))[2:] == bytes(4)


@given(st.lists(st.binary(max_size=60), max_size=8))
def test_noise_moves_no_drive(pieces: list[bytes]) -> None:
    drive = OrientalController(Motor(Mechanics(), SystemClock()))
    for piece in pieces:
        drive.answer(piece)
    assert drive.triggers == drive.homings == 0


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        ("03 0058 0000", "83 03"),  # no registers
        ("03 0059 0010", "83 02"),  # past the block
        ("03 1000 0001", "83 02"),
        ("06 00CC 0001", "86 02"),  # cannot be set
        ("04 0058 0001", "84 01"),
        ("10 0058 0002 05 0000000000", "90 03"),  # byte count
        ("10 005A 0002 04 0000 0009", "90 03"),  # no such type here
        ("06 0065 03E9", "86 03"),  # more than all of the current
        ("06 0065 03E8", "06 0065 03E8"),
        ("03 0064 0002", "03 04 0000 03E8"),
    ],
)
def test_the_emulated_drive_answers_or_refuses(request_: str, answer: str) -> None:
    drive = OrientalController(Motor(FAST, SystemClock()), unit=5)
    asked = bytes.fromhex("05" + request_)
    told = bytes.fromhex("05" + answer)
    assert drive.answer(asked + crc(asked)) == told + crc(told)
    header = bytes.fromhex("1234 0000")
    framed = header + len(asked).to_bytes(2, "big") + asked
    gateway = ModbusTcpGateway([drive])
    assert gateway.answer(framed[:5]) == b""
    assert gateway.answer(framed[5:]) == header + len(told).to_bytes(2, "big") + told


def test_the_emulated_drive_is_deaf_to_noise_and_to_what_is_for_others() -> None:
    drive = OrientalController(Motor(FAST, SystemClock()), now_s=iter(range(9)).__next__)
    for unit, broken in ((1, 1), (2, 0)):
        asked = bytes([unit]) + bytes.fromhex("06 007D 0010")
        check = crc(asked)
        assert drive.answer(asked + bytes([check[0] ^ broken]) + check[1:]) == b""
    assert drive.homings == 0
    half = bytes.fromhex("01 06 00")
    whole = bytes.fromhex("01 06 007D 0010")
    assert drive.answer(half) == b""  # never finished: the next bytes come much later
    assert drive.answer(whole + crc(whole)) == whole + crc(whole)
    assert drive.homings == 1


def test_a_request_to_all_drives_is_done_and_not_answered() -> None:
    drive = OrientalController(Motor(FAST, SystemClock()))
    asked = bytes.fromhex("00 06 007D 0010")
    assert drive.answer(asked + crc(asked)) == b""
    assert drive.homings == 1
