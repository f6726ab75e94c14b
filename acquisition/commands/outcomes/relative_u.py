"""Relative uncertainty as an option states it: in percent, or as a plain number."""

from __future__ import annotations

from instrument.errors import InputError
from instrument.text.quoting import printable
from instrument.text.text_file import parse_number


def parse_relative_u(text: str, option: str) -> float:
    """Relative u: `0.5%`, or 0.005 as a plain number; raises `InputError` that names the option."""
    allowed = "allowed: more than 0 and less than 50 %, as 0.5% or 0.005"
    number, percent = text.strip().removesuffix("%"), text.strip().endswith("%")
    try:
        u = parse_number(number) / (100 if percent else 1)
    except ValueError as error:
        raise InputError(f"{option}: {error}; {allowed}") from None
    if not 0 < u < 0.5:
        raise InputError(f"{option}: {printable(text)}; {allowed}")
    return u
