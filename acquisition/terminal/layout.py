"""Layout of paragraphs and tables for any width of the terminal: no number is ever cut.

Text wraps at spaces, but not between a number and its unit or its uncertainty. A table that is too
wide first wraps its names; if that is not enough, each of its rows becomes a paragraph.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import zip_longest

Row = Sequence[str]

_GAP = "  "
_FIXED = "\u00a0"  # a space at which nothing wraps, printed as a plain one
_UNITS = r"%|°|u\b|deg|1/sr|sr\b|mm\b|s\b|h\b|min\b|[kMG]?B\b|px\b|counts|wavelengths"
_END = "[0-9⁰¹²³⁴-⁹]"  # last digit of a number, perhaps of a power of ten
_INSIDE_QUANTITY = re.compile(rf"(?<={_END}) (?=±|×|{_UNITS})|(?<=[±×<>=≤≥]) (?=[-+0-9.])")
_AFTER_JOINT = re.compile(r"(?<=[+/])(?=\w)")  # in names: lambert+ggx, ks/albedo


def wrapped(text: str, width: int, *, indent: str = "") -> list[str]:
    """Return a text as lines of at most `width` characters; `indent` opens all but the first.

    A word, or a number with its unit, that is longer than the width stays whole.
    """
    words = re.split(r"[ \t\n]+", _INSIDE_QUANTITY.sub(_FIXED, text.strip()))
    return [_plain(line) for line in _filled(words, " ", width, indent)]


def _plain(text: str) -> str:
    return text.replace(_FIXED, " ")


def note_lines(text: str, width: int) -> list[str]:
    """Return a note as an item of a list."""
    return wrapped(f"- {text}", width, indent="  ")


def table_lines(
    header: Row, rows: Sequence[Row], width: int, *, right: bool = True, indent: str = ""
) -> list[str]:
    """Return a table as lines of at most `width` characters.

    The first column holds names, which may wrap after + and /, `indent` opening what follows. The
    other columns hold quantities that never wrap, aligned at the `right` or at the left; columns
    without content are left out.
    """
    shown = [n for n, _ in enumerate(header) if n == 0 or any(row[n] for row in rows)]
    header, rows = [header[n] for n in shown], [[row[n] for n in shown] for row in rows]
    sizes = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    room = width - sum(len(_GAP) + size for size in sizes[1:])
    names = [_filled(_AFTER_JOINT.split(row[0]), "", room, indent) for row in (header, *rows)]
    sizes[0] = max(len(line) for name in names for line in name)
    if sizes[0] > room:
        return [line for row in rows for line in _stacked(header, row, width, indent)]
    lines = [line for row in rows for line in _table_row(row, sizes, right, indent)]
    rule = "─" * (sum(sizes) + len(_GAP) * (len(sizes) - 1))
    return [*_table_row(header, sizes, right, indent), rule, *lines]


def text_table_lines(rows: Sequence[tuple[str, str]], width: int) -> list[str]:
    """Return rows of a name and a text as lines; long texts wrap beside the names."""
    column = max(len(name) for name, _ in rows) + len(_GAP)
    if 2 * column > width:
        return [line for row in rows for line in _stacked(("", ""), row, width, "")]
    lines = []
    for name, text in rows:
        first, *more = wrapped(text, width - column) or [""]
        lines += [f"{name:{column}}{first}".rstrip(), *(" " * column + line for line in more)]
    return lines


def _table_row(row: Row, sizes: Sequence[int], right: bool, indent: str) -> Iterator[str]:
    """Lines of a row: the name wraps, the quantities stand in its first line."""
    side = ">" if right else "<"
    cells = [f"{cell:{side}{size}}" for cell, size in zip(row[1:], sizes[1:], strict=True)]
    name = _filled(_AFTER_JOINT.split(row[0]), "", sizes[0], indent)
    for part, rest in zip_longest(name, [_GAP.join(cells)], fillvalue=""):
        yield _plain(f"{part:{sizes[0]}}{_GAP}{rest}".rstrip())


def _stacked(header: Row, row: Row, width: int, indent: str) -> Iterator[str]:
    """Lines of a row as a paragraph: its name, then each quantity after the name of its column."""
    yield from _filled(_AFTER_JOINT.split(row[0]), "", width, indent)
    inside = 2 * _GAP
    if len(row) == 2:
        lines = wrapped(row[1], width - len(inside))
    else:
        pairs = zip(header[1:], row[1:], strict=True)
        words = [f"{title} {cell}" for title, cell in pairs if cell]
        lines = _filled(words, _GAP, width - len(inside), "")
    yield from (inside + _plain(line) for line in lines)


def _filled(words: Sequence[str], joint: str, width: int, indent: str) -> list[str]:
    """Words joined to lines of at most `width` characters; `indent` opens all but the first."""
    lines = list(words[:1])
    for word in words[1:]:
        if len(lines[-1]) + len(joint) + len(word) <= width:
            lines[-1] += joint + word
        else:
            lines.append(indent + word)
    return lines
