"""Values from outside as error messages quote them: in one line, printable, and short."""

from __future__ import annotations

_LONGEST = 40  # characters of a text that are quoted


def printable(text: str) -> str:
    """Return a file name or a column name unchanged if it is printable, else its `repr`."""
    return text if text.isprintable() else repr(text)


def shown(value: object) -> str:
    """Return a value from a YAML or CSV file as YAML writes it; of a long text, the beginning."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return repr(value if len(value) <= _LONGEST else value[:_LONGEST] + "...")
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, dict):
        return "a block of keys"
    return "nothing" if value is None else str(value)
