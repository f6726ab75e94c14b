"""Text made safe for terminals: control characters from files and devices are escaped.

An escape sequence can repaint a terminal, and a character that reverses the writing direction can
make one text look like another.
"""

from __future__ import annotations

import unicodedata

_DIRECTION = frozenset("\u061c\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
_UNSAFE_CATEGORIES = frozenset({"Cc", "Cs", "Zl", "Zp"})  # controls, surrogates, separators
_ALLOWED_CONTROLS = frozenset("\n\t")


def first_unfit(text: str) -> str | None:
    """Return the first character that is not printable, a tab or a line end; None if none."""
    if text.isprintable():
        return None
    return next(filter(_unfit, text), None)


def escape_control_characters(text: str) -> str:
    """Return the text with each unsafe character as its escape, such as `\\x1b`."""
    if first_unfit(text) is None:
        return text
    return "".join(repr(c)[1:-1] if _unfit(c) else c for c in text)


def _unfit(character: str) -> bool:
    if character in _ALLOWED_CONTROLS:
        return False
    return character in _DIRECTION or unicodedata.category(character) in _UNSAFE_CATEGORIES
