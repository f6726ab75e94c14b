"""Timing: a time comes with the value that was timed."""

from __future__ import annotations

import pytest

from acquisition.benchmark.timing import timed


def test_a_time_comes_with_the_value_that_was_timed() -> None:
    calls: list[str] = []

    def action() -> int:
        calls.append("timed")
        return sum(range(1000))

    found = timed(action, 3, lambda: calls.append("before"))
    assert found.value == 499_500
    assert 0 < found.least_s <= found.median_s
    assert found.spread >= 0
    assert calls == ["before", "timed"] * 4  # one of them not counted
    assert timed(action, 3).value == 499_500
    with pytest.raises(ValueError, match="repeats = 2; allowed: 3 or more"):
        timed(action, 2)
