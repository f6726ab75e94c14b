"""Board of messages: the newest of each key, in the order of the changes."""

from __future__ import annotations

import random
from collections.abc import Mapping
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.live.following.board import Board

PUTS = st.lists(st.tuples(st.sampled_from("abcdef"), st.integers(0, 3)), max_size=60)


def seen(board: Board, after: int, most_bytes: int = 10**6) -> list[tuple[int, Mapping[str, Any]]]:
    """Everything after a number, read in pieces."""
    found = []
    while messages := board.after(after, most_bytes):
        found += [(m.number, m.data) for m in messages]
        after = messages[-1].number
    return found


@settings(max_examples=50)
@given(puts=PUTS, joined=st.integers(0, 60), most_bytes=st.integers(1, 300))
def test_whoever_reads_whenever_has_the_same_in_the_end(
    puts: list[tuple[str, int]], joined: int, most_bytes: int
) -> None:
    """Reader that was there from the beginning, or came later, or reads in small pieces."""
    board, early, last = Board(), dict[str, Any](), 0
    for count, (key, value) in enumerate(puts):
        board.put(key, "kind", {"key": key, "value": value})
        if count < joined:
            for number, data in seen(board, last):
                early[str(data["key"])], last = data, number
    for _, data in seen(board, last):
        early[str(data["key"])] = data
    late = {str(data["key"]): data for _, data in seen(board, 0, most_bytes)}
    assert early == late == {key: {"key": key, "value": value} for key, value in puts}


@settings(max_examples=30)
@given(puts=PUTS)
def test_numbers_rise_and_each_key_comes_once(puts: list[tuple[str, int]]) -> None:
    board = Board()
    for key, value in puts:
        board.put(key, "kind", {"key": key, "value": value})
    numbers = [number for number, _ in seen(board, 0)]
    assert numbers == sorted(set(numbers))
    assert len(numbers) == len({key for key, _ in puts})


def test_what_is_replaced_takes_no_room() -> None:
    board = Board()
    for count in range(5000):
        board.put(f"key {random.Random(count).randrange(10)}", "kind", {"count": count})
    assert len(board._order) < 200


def test_the_same_content_again_is_no_change() -> None:
    board, told = Board(), []
    with board.told(lambda: told.append(1)):
        board.put("a", "kind", {"x": 1})
        board.put("a", "kind", {"x": 1})
    assert (board.number, told) == (1, [1])


def test_a_position_is_one_of_this_board_or_none() -> None:
    board = Board()
    board.put("a", "kind", {"x": 1})
    assert board.position(f"{board.boot}-1") == 1
    assert board.position(None) == board.position("") == 0
    for foreign in (f"{board.boot}-2", "deadbeef-1", "1", f"{board.boot}-", f"{board.boot}--1",
                    f"{board.boot}-١", f"{board.boot}-{10**400}"):  # fmt: skip
        assert board.position(foreign) is None


@pytest.mark.parametrize("text", ["two\nlines\r\n", "θ\u2028", "\udce9", "data: x\n\nevent: y"])
def test_no_text_breaks_the_event(text: str) -> None:
    """One event has one data line, whatever is in it."""
    board = Board()
    board.put("a", "kind", {"text": text})
    (message,) = board.after(0, 1)
    lines = message.text.decode().splitlines() if "\u2028" not in text else [""] * 4
    assert message.text.count(b"\n") == 4
    assert b"\r" not in message.text
    assert len(lines) == 4
