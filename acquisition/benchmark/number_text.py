"""Numbers as text for charts and captions."""

from __future__ import annotations

import math

_POWERS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def short(value: float) -> str:
    """Format as a plain number from 0.01 to 5000, otherwise as one digit and a power of ten."""
    if value == 0 or 0.009 < value < 5001:
        return rounded(value)
    exponent = math.floor(math.log10(value) + 1e-9)
    first = round(value / 10**exponent)
    if first == 10:
        first, exponent = 1, exponent + 1
    power = "10" + str(exponent).translate(_POWERS)
    return power if first == 1 else f"{first}·{power}"


def rounded(value: float) -> str:
    """Format with two significant digits and no exponent; integers from 100 on in full."""
    if value >= 100:
        return f"{value:.0f}"
    return f"{float(f'{value:.2g}'):g}"


def percent(part: float) -> str:
    """Format a fraction as a percentage of two significant digits."""
    return f"{rounded(100 * part)} %"
