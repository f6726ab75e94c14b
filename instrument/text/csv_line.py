"""Fields of one CSV line, quoted or not, with the column at which each begins.

The standard library's reader does not give the position of a field, which every message needs.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice

from instrument.text.quoting import shown

_QUOTED = re.compile(r'[ \t]*"((?:[^"]|"")*+)"[ \t]*(?=,|\Z)')


class QuoteError(Exception):
    """A quote is not closed at the end of its field; `column` of the field counts from 1."""

    def __init__(self, column: int, text: str) -> None:
        what = f"{shown(text)}: the quote is not closed before the next comma or the end of line"
        super().__init__(f'{what}; allowed: text in quotes, with "" for a quote inside it')
        self.column = column


def texts_of(line: str) -> list[str]:
    """Texts of the fields, without quotes. Raises `QuoteError`."""
    return [text for _, text in fields_of(line)] if '"' in line else line.split(",")


def fields_of(line: str) -> Iterator[tuple[int, str]]:
    """Column (from 1) of the first non-blank character, and text, of each field.

    Raises `QuoteError` on reaching a field whose quote is not closed.
    """
    start = 0
    while start <= len(line):
        end = line.find(",", start)
        raw = text = line[start : end if end >= 0 else len(line)]
        if '"' in raw:
            raw, text = _unquoted(line, start, raw)
        inside = raw.lstrip()
        yield start + (len(raw) - len(inside) if inside else 0) + 1, text
        start += len(raw) + 1


def _unquoted(line: str, start: int, raw: str) -> tuple[str, str]:
    """A field with its quotes, and its text; `raw` is the line from `start` to the next comma."""
    quoted = _QUOTED.match(line, start)
    if quoted is not None:
        return quoted[0], quoted[1].replace('""', '"')
    inside = raw.lstrip()
    if inside.startswith('"'):
        raise QuoteError(start + len(raw) - len(inside) + 1, raw.strip())
    return raw, raw


def column_of(line: str, index: int) -> int:
    """Column (from 1) of the field at an index, in a line that was read before."""
    return next(islice(fields_of(line), index, None))[0]
