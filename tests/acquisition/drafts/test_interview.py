"""Interview: repeats a question with the reason, takes defaults, and names what nobody can say."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import pytest

from acquisition.drafts.interview import Draft, Interview
from acquisition.drafts.question import Answers, Question, number, number_of
from instrument.errors import InputError, OperatorStop


def _script(answers: Answers) -> Iterator[Question]:
    yield number("low", "lower end", 1.0, 0.0, 9.0)
    yield number("high", "upper end", number_of(answers, "low") + 1, 0.0, 9.0)
    yield number("steps", "steps per degree", 100.0, guess="a wrong one turns too far")


def _mistakes(answers: Answers) -> Sequence[str]:
    wrong = number_of(answers, "low") >= number_of(answers, "high")
    return ["high: allowed: more than low"] if wrong else []


DRAFT = Draft(what="gonio new thing", script=_script, text=str, mistakes=_mistakes)


def _typed(*answers: str, **given: str) -> tuple[str, list[str]]:
    """Text made of what a person types, and what is said to them."""
    said: list[str] = []
    lines = iter(answers)

    def ask(prompt: str) -> str:
        said.append(prompt.split(":", maxsplit=1)[0])
        try:
            return next(lines)
        except StopIteration:
            raise EOFError from None

    return Interview(given=given, ask=ask, say=said.append).text_of(DRAFT), said


def test_enter_takes_each_default_and_a_default_follows_earlier_answers() -> None:
    assert _typed("", "", "")[0] == "{'low': 1.0, 'high': 2.0, 'steps': 100.0}"
    assert _typed("4", "", "")[0] == "{'low': 4.0, 'high': 5.0, 'steps': 100.0}"


def test_a_wrong_answer_is_named_and_asked_for_again() -> None:
    text, said = _typed("ten", "10", "4", "3", "6", "")
    assert text == "{'low': 4.0, 'high': 6.0, 'steps': 100.0}"
    assert said == [
        "low", "  low: 'ten'; allowed: a number from 0 to 9",
        "low", "  low: 10.0; allowed: a number from 0 to 9",
        "low",
        "high", "  high: high: allowed: more than low",
        "high",
        "steps",
    ]  # fmt: skip


@pytest.mark.parametrize("answers", [("q",), ("4", "Quit"), ("4",)])
def test_q_and_the_end_of_input_stop_without_a_file(answers: tuple[str, ...]) -> None:
    with pytest.raises(OperatorStop, match="nothing is written"):
        _typed(*answers)


def test_what_is_given_beforehand_is_not_asked() -> None:
    text, said = _typed("", "", low="3")
    assert text == "{'low': 3.0, 'high': 4.0, 'steps': 100.0}"
    assert said == ["high", "steps"]


def _alone(**given: str) -> str:
    return Interview(given=given).text_of(DRAFT)


def test_with_nobody_to_ask_the_defaults_are_taken_but_no_guess() -> None:
    assert _alone(steps="5") == "{'low': 1.0, 'high': 2.0, 'steps': 5.0}"
    with pytest.raises(InputError) as refused:
        _alone()
    assert str(refused.value) == (
        "gonio new thing: nobody to ask for steps (steps per degree); a wrong one turns too far: "
        "add --set steps=VALUE"
    )


def test_a_wrong_option_is_named() -> None:
    with pytest.raises(InputError, match=r"^--set low: 10\.0; allowed: a number from 0 to 9$"):
        _alone(low="10", steps="5")
    with pytest.raises(InputError, match=r"^--set high: high: allowed: more than low$"):
        _alone(low="4", high="3", steps="5")
    with pytest.raises(
        InputError, match=r"^--set width: no question .* allowed: low, high, steps$"
    ):
        _alone(width="4", steps="5")
