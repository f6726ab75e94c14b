"""Fields of a CSV line: quotes, and the column of each field."""

from __future__ import annotations

import pytest

from tests.support.analysis.csv_texts import BARE, PLAIN, assert_mistake

# Table, text to replace, replacement, and the whole message, with positions counted by hand.
MISTAKES = {
    "text in quotes, behind spaces": (
        PLAIN,
        "0.25",
        '  "da""rk"',
        "2:14: brdf: 'da\"rk' is text; allowed: -1e15 to 1e15 1/sr",
    ),
    "quote not closed": (
        PLAIN,
        "-20.5",
        '"-20.5',
        "2:4: row: '\"-20.5': the quote is not closed before the next comma or the end of line;"
        ' allowed: text in quotes, with "" for a quote inside it',
    ),
    "quote closed too early": (
        PLAIN,
        "-20.5",
        '"-20".5',
        "2:4: row: '\"-20\".5': the quote is not closed before the next comma or the end of line;"
        ' allowed: text in quotes, with "" for a quote inside it',
    ),
    "quote not closed in the header": (
        BARE,
        "brdf",
        '"brdf',
        "1:34: header: '\"brdf': the quote is not closed before the next comma or the end of line;"
        ' allowed: text in quotes, with "" for a quote inside it',
    ),
}


@pytest.mark.parametrize("kind", MISTAKES)
def test_a_mistake_in_quotes_is_reported_with_its_position(kind: str) -> None:
    assert_mistake(*MISTAKES[kind])
