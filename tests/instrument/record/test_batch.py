"""Choices of steps in a record: read as they were written, and refused in any other form."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from instrument.errors import InputError
from instrument.record.event_kinds import CHOSEN
from instrument.record.reading import Batch, batches_of
from instrument.record.record import Record

_U = st.dictionaries(st.text(), st.none() | st.floats(0, 1e6), max_size=3)


@st.composite
def _batches(draw: st.DrawFn) -> Batch:
    steps = draw(st.lists(st.integers(0, 10_000), unique=True, max_size=6))
    words = st.from_regex(r"([A-Za-z0-9][ -~]{0,20})?", fullmatch=True)
    reasons = draw(st.lists(words, min_size=len(steps), max_size=len(steps)))
    return Batch(
        number=draw(st.integers(0, 100)),
        steps=tuple(steps),
        frames=draw(st.tuples(*[st.integers(1, 10_000)] * len(steps))),
        reasons=tuple(reasons),
        model=draw(st.text()),
        verdict=draw(st.text()),
        fitted=draw(_U),
        forecast=draw(_U),
        checked=draw(_U),
        seconds=draw(st.floats(0, 1e6)),
        end=draw(st.text()),
    )


@given(_batches())
def test_a_choice_is_read_as_it_was_written(batch: Batch) -> None:
    assert Batch.of_text(batch.text) == batch
    assert batches_of([("", CHOSEN, batch.text), ("", "other", "{}")]) == [batch]


_GOOD = Batch(number=0, steps=(3, 1), frames=(4, 16), reasons=("a", "b"), fitted={"albedo": 0.1})
_WRONG: list[tuple[str, Any, str]] = [
    ("steps", [1, 1], "steps is '[1, 1]'; allowed: different whole numbers"),
    ("steps", [-1, 2], "steps"),
    ("steps", [1.5, 2], "steps"),
    ("steps", [True, 2], "steps"),
    ("steps", 3, "steps"),
    ("number", "0", "number is '0'; allowed: a whole number"),
    ("frames", [4], "1 frames for 2 steps"),
    ("frames", [4, 0], "frames is '[4, 0]'; allowed: whole numbers from 1"),
    ("reasons", ["a"], "1 reasons for 2 steps"),
    ("reasons", ["a", 2], "reasons"),
    ("reasons", ["=1+1", "b"], "reasons is"),
    ("reasons", ["a\x1b[2J", "b"], "reasons is"),
    ("fitted", {"albedo": -0.1}, "fitted"),
    ("fitted", {"albedo": "0.1"}, "fitted"),
    ("seconds", None, "seconds"),
    ("end", None, "end"),
]


@pytest.mark.parametrize(("key", "value", "words"), _WRONG)
def test_another_form_is_refused(key: str, value: object, words: str, tmp_path: Path) -> None:
    text = json.dumps({**json.loads(_GOOD.text), key: value})
    with pytest.raises(ValueError, match=r"allowed|for 2 steps") as refused:
        Batch.of_text(text)
    assert words in str(refused.value)
    with Record.create(tmp_path / "run", {}) as record:
        record.add_event("", CHOSEN, text)
    with pytest.raises(InputError, match=r"event 1: is no choice of steps"):
        Record.open(tmp_path / "run")


@pytest.mark.parametrize("text", ["", "[", "[]", "{}", "1", "[" * 100_000, '{"number": NaN}'])
def test_a_text_that_is_no_choice_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r".+"):
        Batch.of_text(text)


@pytest.mark.parametrize(
    ("number", "steps", "words"),
    [(0, (5,), "allowed: rising numbers"), (1, (5, 3), "step 3 is chosen twice")],
)
def test_choices_that_contradict_one_another_are_refused(
    number: int, steps: tuple[int, ...], words: str, tmp_path: Path
) -> None:
    other = Batch(number=number, steps=steps, frames=(4,) * len(steps), reasons=("",) * len(steps))
    with Record.create(tmp_path / "run", {}) as record:
        for batch in (_GOOD, other):
            record.add_event("", CHOSEN, batch.text)
    with pytest.raises(InputError, match=words):
        Record.open(tmp_path / "run")
