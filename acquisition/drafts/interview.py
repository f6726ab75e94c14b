"""Interview: asks each question until its answer makes a file that loads.

An answer is refused for the mistakes that it adds: those of the file made of the answers so far and
of the defaults of the questions that follow.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from acquisition.drafts.question import Answers, Question, Script
from acquisition.drafts.yaml_words import Value
from instrument.errors import InputError, OperatorStop

_STOP = ("q", "quit", "stop")

Ask = Callable[[str], str]
"""Prints a prompt and returns the answer; raises `EOFError` at the end of input."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """Kind of file: its questions, its text, and its mistakes when it is loaded.

    what: its name in messages. Each of the others takes the answers so far.
    """

    what: str
    script: Callable[[Answers], Script]
    text: Callable[[Answers], str]
    mistakes: Callable[[Answers], Sequence[str]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Interview:
    """Source of answers: those given beforehand by key, then a person, or else the defaults.

    ask, say: print a prompt and wait, print a line; None where nobody can answer.
    """

    given: Mapping[str, str]
    ask: Ask | None = None
    say: Callable[[str], None] = print

    def text_of(self, draft: Draft) -> str:
        """Return the text of a file that loads. Raises `InputError`, and `OperatorStop` for `q`."""
        answers: Answers = {}
        known = draft.mistakes(_filled(draft, {}))
        for question in draft.script(answers):
            value = self._value(question, draft, answers, known)
            if value != question.default:
                known = draft.mistakes(_filled(draft, {**answers, question.key: value}))
            answers[question.key] = value
        unknown = [key for key in self.given if key not in answers]
        if unknown:
            raise InputError(
                f"--set {unknown[0]}: no question for {draft.what} with these answers; allowed: "
                f"{', '.join(answers)}"
            )
        if known:
            raise InputError(*known)
        return draft.text(answers)

    def _value(
        self, question: Question, draft: Draft, answers: Answers, known: Sequence[str]
    ) -> Value:
        if question.key in self.given:
            text = self.given[question.key]
            try:
                return _accepted(question, text, draft, answers, known)
            except InputError as error:
                raise InputError(*(f"--set {question.key}: {p}" for p in error.problems)) from None
        if self.ask is not None:
            return self._asked(self.ask, question, draft, answers, known)
        if question.guess:
            raise InputError(
                f"{draft.what}: nobody to ask for {question.key} ({question.text}); "
                f"{question.guess}: add --set {question.key}=VALUE"
            )
        return question.default

    def _asked(
        self, ask: Ask, question: Question, draft: Draft, answers: Answers, known: Sequence[str]
    ) -> Value:
        while True:
            try:
                text = ask(question.prompt()).strip()
            except (EOFError, OSError):
                raise OperatorStop("standard input ended: nothing is written") from None
            if not text:
                return question.default
            if text.lower() in _STOP:
                raise OperatorStop(f"stopped at the question {question.key}: nothing is written")
            try:
                return _accepted(question, text, draft, answers, known)
            except InputError as error:
                for problem in error.problems:
                    self.say(f"  {question.key}: {problem}")


def _accepted(
    question: Question, text: str, draft: Draft, answers: Answers, known: Sequence[str]
) -> Value:
    """Return the value of an answer; raise `InputError` with the mistakes that it adds."""
    value = question.answer(text)
    if value != question.default:
        found = draft.mistakes(_filled(draft, {**answers, question.key: value}))
        added = [mistake for mistake in found if mistake not in known]
        if added:
            raise InputError(*added)
    return value


def _filled(draft: Draft, answers: Answers) -> Answers:
    """Return these answers, and the defaults of all questions without one."""
    whole: Answers = {}
    for question in draft.script(whole):
        whole[question.key] = answers.get(question.key, question.default)
    return whole
