"""Answers of each kind: taken as meant, or refused with the reason."""

from __future__ import annotations

import pytest

from acquisition.drafts.question import Question, choice, number, numbers, words
from instrument.errors import InputError

LENGTH = number("beam_length_mm", "lens to the axis, in mm", 800.0, open_low=True)
COUNT = number("frames", "frames averaged", 4, 1, 1000, whole=True)
ANGLES = numbers("theta_i_deg", "angles, in degrees", (30.0, 45.0), 0.0, 89.5, 3)
NAME = words("name", "name of the rig", "bench")
KIND = choice("outline", "outline", (("rectangle", "thin"), ("none", "round")), "rectangle")


@pytest.mark.parametrize(
    ("question", "answer", "value"),
    [
        (LENGTH, "900", 900.0),
        (LENGTH, " 1.5e+3 ", 1500.0),
        (COUNT, "8", 8),
        (COUNT, "8.0", 8),
        (ANGLES, "10, 20 30", (10.0, 20.0, 30.0)),
        (ANGLES, "[5]", (5.0,)),
        (NAME, "Rig: of #3", "Rig: of #3"),
        (KIND, "2", "none"),
        (KIND, "none", "none"),
    ],
)
def test_an_answer_is_taken_as_meant(question: Question, answer: str, value: object) -> None:
    assert question.answer(answer) == value


@pytest.mark.parametrize(
    ("question", "answer", "reason"),
    [
        (LENGTH, "long", r"'long'; allowed: a number greater than 0$"),
        (LENGTH, "800 mm", r"'800 mm'; allowed: .* \(write 800: the unit is in the key's name\)"),
        (LENGTH, "0", "0.0; allowed: a number greater than 0"),
        (LENGTH, ".inf", "'.inf'; allowed: a number greater than 0"),
        (LENGTH, ".nan", "'.nan'; allowed: a number greater than 0"),
        (LENGTH, "true", "'true'; allowed: a number greater than 0"),
        (LENGTH, "9" * 400, "allowed: a number greater than 0"),
        (COUNT, "0", "0; allowed: a whole number from 1 to 1000"),
        (COUNT, "2.5", "'2.5'; allowed: a whole number from 1 to 1000"),
        (ANGLES, "10 95", "95.0; allowed: 1 to 3 numbers from 0 to 89.5, with spaces between"),
        (ANGLES, "1 2 3 4", "4 numbers; allowed: 1 to 3 numbers"),
        (ANGLES, ",", "0 numbers; allowed: 1 to 3 numbers"),
        (ANGLES, "10 north", "'north'; allowed: 1 to 3 numbers"),
        (NAME, "x" * 201, "allowed: text of 1 to 200 characters"),
        (NAME, "a\x1b[2J", r"holds a control character \(\\x1b\)"),
        (KIND, "3", "'3'; allowed: rectangle or none, or its number"),
        (KIND, "0", "'0'; allowed: rectangle or none, or its number"),
        (KIND, "٣", "allowed: rectangle or none"),
    ],
)
def test_a_wrong_answer_is_refused_with_its_reason(
    question: Question, answer: str, reason: str
) -> None:
    with pytest.raises(InputError, match=reason):
        question.answer(answer)


def test_the_prompt_states_unit_allowed_answers_and_default() -> None:
    assert LENGTH.prompt() == (
        "beam_length_mm: lens to the axis, in mm (a number greater than 0) [800.0]:"
    )
    assert ANGLES.prompt().endswith("with spaces between them) [30.0 45.0]:")
    assert KIND.prompt() == (
        "outline: outline\n   1  rectangle  thin\n   2  none       round\n[rectangle]:"
    )
