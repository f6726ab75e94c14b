"""Literal answers of the emulated SMC100, with states and error codes of the maker's manual."""

from __future__ import annotations

from sim.clock import SimulatedClock
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.newport_controller import NewportController


def controller() -> tuple[NewportController, SimulatedClock]:
    clock = SimulatedClock()
    return NewportController(Motor(Mechanics(), clock)), clock


def test_a_move_before_homing_is_refused_with_error_h() -> None:
    newport, _ = controller()
    assert newport.answer(b"1TS\r\n") == b"1TS00000A\r\n"  # not referenced
    assert newport.answer(b"1PA10\r\n") == b""
    assert newport.answer(b"1TE\r\n") == b"1TEH\r\n"
    assert newport.answer(b"1TE\r\n") == b"1TE@\r\n"  # cleared by reading it
    assert newport.moves == 0


def test_the_states_of_homing_and_of_a_move() -> None:
    newport, clock = controller()
    newport.answer(b"1OR\r\n")
    assert newport.answer(b"1TS\r\n") == b"1TS00001E\r\n"  # homing
    clock.sleep(newport.motor.mechanics.homing_s)
    assert newport.answer(b"1TS\r\n") == b"1TS000032\r\n"  # ready from homing
    newport.answer(b"1PA10\r\n")
    assert newport.answer(b"1TS\r\n") == b"1TS000028\r\n"  # moving
    clock.sleep(10.0)
    assert (
        newport.answer(b"1TS\r\n1TP\r\n") == b"1TS000033\r\n1TP10.000000\r\n"
    )  # ready from moving


def test_a_command_may_arrive_in_pieces_and_another_address_is_ignored() -> None:
    newport, _ = controller()
    assert newport.answer(b"1T") == b""
    assert newport.answer(b"S\r\n") == b"1TS00000A\r\n"
    assert newport.answer(b"2TS\r\n") == b""
