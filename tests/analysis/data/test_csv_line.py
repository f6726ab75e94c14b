"""Fields of a CSV line: quotes, and the column of each field."""

from __future__ import annotations

import pytest

from tests.support.analysis.csv_texts import BARE, PLAIN, changed, problems

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
def test_a_mistake(kind: str) -> None:
    text, old, new, message = MISTAKES[kind]
    (found, *more) = problems(changed(text, old, new))
    if kind == "column missing":  # by the comma too many in the header
        assert more.pop(0).startswith("data.csv:2:16: row: 4 fields; allowed: 5")
        assert more.pop(0).startswith("data.csv:3:13: row: 4 fields; allowed: 5")
    assert found.startswith(f"data.csv:{message}")
    assert len(found) - len(f"data.csv:{message}") < 30  # the rest of the sentence is covered above
    assert not more
