"""Characters that a terminal takes for a command are found and escaped; all others stay."""

from __future__ import annotations

import pytest

from instrument.text.terminal_safe import escape_control_characters, first_unfit


def test_printable_text_is_unchanged() -> None:
    plain = "Schaumstoff – 石膏 – ρ = 0,8\u00a0% (à 20\u2009°C)\n\tθᵢ ±2°"
    assert escape_control_characters(plain) == plain
    assert escape_control_characters("a\x1bb\ud800") == "a\\x1bb\\ud800"


@pytest.mark.parametrize(
    "unfit", ["\x1b", "\x07", "\r", "\0", "\x9b", "\u202e", "\u2028", "\ud800"]
)
def test_an_unsafe_character_is_found_and_escaped(unfit: str) -> None:
    assert first_unfit(f"a\tb\n{unfit}{unfit}") == unfit
    assert escape_control_characters(f"a\n{unfit}") == "a\n" + repr(unfit)[1:-1]
