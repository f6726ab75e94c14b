"""Questions with a default, and the kinds of their answers: number, list, text, one of several."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

from acquisition.drafts.yaml_words import Value, yaml_value
from instrument.config.yaml_positions import number_hint, plain_value
from instrument.errors import InputError
from instrument.text.quoting import shown
from instrument.text.terminal_safe import first_unfit

Answers = dict[str, Value]
Script = Iterator["Question"]
"""Questions in their order; each may depend on the answers that were given to those before."""

_LONGEST = 200  # characters of a text, as of names in files


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """Question of one value.

    text: it in words, with its unit. allowed: in words, empty where `offers` say it. parse: answer
    as a value; raises `InputError` with the reason. offers: value and words of each answer that may
    be given by its number. guess: reason why the default is one that a person has to confirm.
    """

    key: str
    text: str
    default: Value
    parse: Callable[[str], Value]
    allowed: str = ""
    offers: tuple[tuple[str, str], ...] = ()
    guess: str = ""

    def prompt(self) -> str:
        """Return what is printed: the question, what is offered, and the default in brackets."""
        width = max((len(word) for word, _ in self.offers), default=0)
        offered = [
            f"\n  {n:2}  {word:{width}}  {text}".rstrip()
            for n, (word, text) in enumerate(self.offers, 1)
        ]
        words = "; ".join(filter(None, (self.allowed, self.guess)))
        allowed = f" ({words})" if words else ""
        gap = "\n" if self.offers else " "
        asked = f"{self.key}: {self.text}{allowed}{''.join(offered)}"
        return f"{asked}{gap}[{answer_text(self.default)}]:"

    def answer(self, text: str) -> Value:
        """Return the value of an answer; raise `InputError` with what is wrong and allowed."""
        if len(text) < 4 and text.isdecimal() and 1 <= int(text) <= len(self.offers):
            text = self.offers[int(text) - 1][0]
        unfit = first_unfit(text)
        if unfit is not None:
            raise InputError(f"{shown(text)} holds a control character ({ascii(unfit)[1:-1]})")
        return self.parse(text)


def answer_text(value: Value) -> str:
    """Return a value as it is typed."""
    if isinstance(value, tuple):
        return " ".join(map(yaml_value, value))
    return value if isinstance(value, str) else yaml_value(value)


def number_of(answers: Answers, key: str) -> float:
    """Return the answer to a question of a number."""
    value = answers[key]
    if not isinstance(value, int | float):
        raise TypeError(f"{key}: {value!r} is no number")
    return value


def number(
    key: str,
    text: str,
    default: float,
    low: float = 0.0,
    high: float = math.inf,
    *,
    open_low: bool = False,
    whole: bool = False,
    guess: str = "",
) -> Question:
    """Question of a number from `low` to `high`; `open_low`: greater than `low`."""
    kind = "a whole number" if whole else "a number"
    if open_low:
        span = f" greater than {low:g}" + (f", at most {high:g}" if high < math.inf else "")
    else:
        span = f" from {low:g} to {high:g}" if high < math.inf else f" of at least {low:g}"
    allowed = f"{kind}{span}"

    def parse(answer: str) -> Value:
        value = _number(answer, allowed, whole)
        if not low <= value <= high or (open_low and value == low):
            raise InputError(f"{shown(value)}; allowed: {allowed}")
        return value

    first = int(default) if whole else float(default)
    return Question(key=key, text=text, default=first, parse=parse, allowed=allowed, guess=guess)


def _number(text: str, allowed: str, whole: bool) -> float:
    """Return a number by the rules of YAML; raise `InputError` for any other text."""
    value, hint = plain_value(text.strip()), None
    if not isinstance(value, int | float) or isinstance(value, bool):
        hint = number_hint(text, whole=whole)
    else:
        with suppress(OverflowError):
            found = float(value)
            if math.isfinite(found) and (found.is_integer() or not whole):
                return int(found) if whole else found
    raise InputError(f"{shown(text)}; allowed: {allowed}{f' ({hint})' if hint else ''}")


def numbers(
    key: str, text: str, default: Sequence[float], low: float, high: float, most: int
) -> Question:
    """Question of one to `most` numbers, with spaces or commas between them."""
    allowed = f"1 to {most} numbers from {low:g} to {high:g}, with spaces between them"

    def parse(answer: str) -> Value:
        words = [word for word in re.split(r"[\s,;]+", answer.strip("[] ")) if word]
        values = tuple(_number(word, allowed, whole=False) for word in words)
        wrong = [value for value in values if not low <= value <= high]
        if wrong or not 1 <= len(values) <= most:
            what = shown(wrong[0]) if wrong else f"{len(values)} numbers"
            raise InputError(f"{what}; allowed: {allowed}")
        return values

    return Question(
        key=key, text=text, default=tuple(map(float, default)), parse=parse, allowed=allowed
    )


def words(key: str, text: str, default: str, longest: int = _LONGEST) -> Question:
    """Question of a text in one line."""
    allowed = f"text of 1 to {longest} characters"

    def parse(answer: str) -> Value:
        if not 1 <= len(answer) <= longest or "\t" in answer or "\n" in answer:
            raise InputError(f"{shown(answer)}; allowed: {allowed}")
        return answer

    return Question(key=key, text=text, default=default, parse=parse, allowed=allowed)


def choice(
    key: str,
    text: str,
    offers: Sequence[tuple[str, str]],
    default: str,
    *,
    other: Callable[[str], str] | None = None,
    guess: str = "",
) -> Question:
    """Question of one of several words, or of what `other` takes, which raises `InputError`."""
    names = [name for name, _ in offers]

    def parse(answer: str) -> Value:
        if answer in names:
            return answer
        if other is not None:
            return other(answer)
        raise InputError(f"{shown(answer)}; allowed: {' or '.join(names)}, or its number")

    return Question(
        key=key, text=text, default=default, parse=parse, offers=tuple(offers), guess=guess
    )
