"""Column of a CSV table: name, unit, allowed values, and the parsing of a number in it."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np

from instrument.geometry import FloatArray
from instrument.text.text_file import parse_number


@dataclass(frozen=True, slots=True)
class Column:
    """A column that is read: unit, and allowed values, in words and as limits.

    whole: only whole numbers are allowed.
    """

    name: str
    unit: str
    allowed: str
    low: float = -math.inf
    high: float = math.inf
    whole: bool = False

    def parse(self, text: str) -> float:
        """Parse a number in the column's unit; `ValueError` states the problem and the limits."""
        try:
            value = parse_number(text)
        except ValueError as error:
            raise ValueError(f"{error}; allowed: {self.allowed}{_hint(text)}") from None
        if not self.low <= value <= self.high or (self.whole and value % 1):
            found = f"{text.strip()[:40]} {self.unit}".strip()
            raise ValueError(f"{found}; allowed: {self.allowed}")
        return value

    def allows(self, values: FloatArray) -> bool:
        """True if all numbers (N,), in the column's unit, are allowed: none is NaN or infinite."""
        inside = np.all((values >= self.low) & (values <= self.high) & np.isfinite(values))
        return bool(inside and not (self.whole and np.any(values % 1)))


# A number in an everyday form: 0,5; −5 with a typographic minus; 30° or 30 deg.
_EVERYDAY = re.compile(r"([-+]?[0-9]+(?:[.,][0-9]+)?)\s*(?:°|deg|degrees)?")

_LONGEST = 40  # characters of a number that is suggested


def _hint(text: str) -> str:
    """Correction of a number in an everyday form."""
    found = _EVERYDAY.fullmatch(text.strip().replace("−", "-").replace("–", "-"))
    return f" (write {found[1].replace(',', '.')})" if found and len(text) <= _LONGEST else ""
