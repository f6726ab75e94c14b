"""Emulated AZ drive: bytes of the maker's example and of the Modbus specification."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from instrument.clock import SystemClock
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.oriental_controller import OrientalController, crc
from tests.support.stages.emulated_az_drive import FAST, MAKERS_EXAMPLE
from tests.support.stages.modbus_tcp_gateway import ModbusTcpGateway


def test_the_emulated_drive_takes_the_makers_example() -> None:
    motor = Motor(replace(FAST, max_deg=180.0), SystemClock())
    drive = OrientalController(motor, steps_per_deg=100.0)
    answer = b"".join(drive.answer(MAKERS_EXAMPLE[i : i + 1]) for i in range(len(MAKERS_EXAMPLE)))
    assert answer == bytes.fromhex("01 10 0058 0010") + crc(bytes.fromhex("01 10 0058 0010"))
    assert drive.triggers == 1
    assert motor.moving


def test_the_check_bytes_are_those_of_the_specification() -> None:
    # "02 07" has CRC 1241 hex, sent low byte first: Modbus over serial line V1.02, 6.2.2
    assert crc(bytes([2, 7])) == bytes([0x41, 0x12])


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
