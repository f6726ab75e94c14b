"""Text from outside, before people see it: what a terminal could take for a command is escaped.

Names, files and devices are others': an escape sequence can repaint a terminal, and a letter that
turns the direction of writing can make a text look like another.
"""

from __future__ import annotations

import unicodedata

_TURNING = frozenset("\u061c\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
_COMMANDS = frozenset({"Cc", "Cs", "Zl", "Zp"})  # control characters, half ones, separators
_PLAIN = frozenset("\n\t")


def first_unfit(text: str) -> str | None:
    """The first character that is no letter, sign, blank, tab or line end; None if all are."""
    if text.isprintable():
        return None
    return next(filter(_unfit, text), None)


def escape_control_characters(text: str) -> str:
    """The text with every such character as its escape, `\\x1b` for one."""
    if first_unfit(text) is None:
        return text
    return "".join(repr(c)[1:-1] if _unfit(c) else c for c in text)


def _unfit(character: str) -> bool:
    if character in _PLAIN:
        return False
    return character in _TURNING or unicodedata.category(character) in _COMMANDS
