"""Values and commented lines of a YAML file, in the form that the loader reads."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence

from instrument.config.yaml_positions import plain_value

Value = str | float | int | bool | tuple[float, ...]
"""Answer to a question."""

_COLUMN = 31  # of the comments, as in the files of configs/
_PLAIN = re.compile(r"[A-Za-z_/][\w ./-]*[\w/]|[A-Za-z_]", re.ASCII)


def yaml_value(value: Value) -> str:
    """Return a value as YAML: text in quotes where it needs them, numbers by the rules of YAML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        plain = _PLAIN.fullmatch(value) and isinstance(plain_value(value), str)
        return value if plain else json.dumps(value, ensure_ascii=False)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return _decimal(value)
    return f"[{', '.join(map(_decimal, value))}]"


def _decimal(value: float) -> str:
    """Return a number with a point, which YAML 1.1 wants also before an exponent."""
    digits, e, exponent = f"{float(value):.10g}".partition("e")
    return f"{digits if '.' in digits else f'{digits}.0'}{e}{exponent}"


def line(key: str, value: Value, comment: str = "", indent: int = 0) -> str:
    """Return one line of a file, with its comment in the column that all share."""
    text = f"{' ' * indent}{key}: {yaml_value(value)}"
    return commented(text, comment)


def commented(text: str, comment: str) -> str:
    """Return a line with a comment behind it; control characters and other letters are escaped."""
    if not comment:
        return text
    return f"{text:{_COLUMN - 2}}  # {in_comment(comment)}"


def in_comment(text: str) -> str:
    """Return a text, perhaps a device's, that ends no comment: one line of printable letters."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def flow(pairs: Sequence[tuple[str, Value]]) -> str:
    """Return a block in one line: {key: value, ...}."""
    return "{" + ", ".join(f"{key}: {yaml_value(value)}" for key, value in pairs) + "}"
