"""Console: durations as the operator reads them."""

from __future__ import annotations

import pytest

from acquisition.terminal.console import duration_text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0 s"), (59.6, "1 min 00 s"), (61.0, "1 min 01 s"), (3661.0, "1 h 01 min")],
)
def test_a_duration_has_the_units_that_matter(seconds: float, text: str) -> None:
    assert duration_text(seconds) == text
