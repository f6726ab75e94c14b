"""Newport framing against literal bytes from the manuals."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.lines.serial_line import Garbled
from drivers.stages import newport_framing


def test_commands_are_the_bytes_of_the_manual() -> None:
    assert newport_framing.command(1, "TP") == b"1TP\r\n"
    assert newport_framing.command(1, "PA", 12.5) == b"1PA12.5\r\n"
    assert newport_framing.command(1, "PA", -0.0000004) == b"1PA-0\r\n"
    assert newport_framing.command(2, "SL", "?") == b"2SL?\r\n"


def test_an_answer_must_repeat_address_and_letters() -> None:
    assert newport_framing.answer_to(1, "TP", b"1TP12.5") == "12.5"
    assert newport_framing.answer_to(1, "TP", b"1TS000033") is None
    assert newport_framing.answer_to(1, "TP", b"2TP12.5") is None
    assert newport_framing.answer_to(1, "TP", b"1TP12.\xff5") is None
    assert newport_framing.answer_to(1, "TE", b"1TE@") == "@"


@pytest.mark.parametrize(
    ("text", "name", "moving", "homed", "fault"),
    [
        ("00000A", "not referenced", False, False, ""),
        ("00001E", "homing", True, False, ""),
        ("000028", "moving", True, True, ""),
        ("000032", "ready", False, True, ""),
        ("000036", "ready", False, True, ""),
        ("00003C", "disabled", False, True, "motor disabled"),
        ("000014", "configuration", False, False, "configuration state"),
        ("00200E", "not referenced", False, False, "0020 following error"),
        ("008033", "ready", False, True, "0080 wrong stage"),
        ("040033", "ready", False, True, "0400 unknown"),
    ],
)
def test_states_of_the_manual(text: str, name: str, moving: bool, homed: bool, fault: str) -> None:
    state = newport_framing.state("theta_r", text)
    assert (state.name, state.moving, state.homed) == (name, moving, homed)
    assert (fault in state.fault) if fault else (state.fault == "")


@pytest.mark.parametrize("text", ["", "0000", "00003G", "0000331", "0000FF"])
def test_invalid_states_are_refused(text: str) -> None:
    with pytest.raises(Garbled, match="theta_r: answers TS with"):
        newport_framing.state("theta_r", text)


@given(st.binary(max_size=60))
def test_noise_is_no_answer(noise: bytes) -> None:
    assert newport_framing.answer_to(1, "TP", b"\xff" + noise) is None
