"""Numbers as charts and captions write them."""

from __future__ import annotations

import math

_POWERS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def short(value: float) -> str:
    """One digit where a power of ten is needed, plain from a hundredth to some thousands."""
    if value == 0 or 0.009 < value < 5001:
        return rounded(value)
    exponent = math.floor(math.log10(value) + 1e-9)
    first = round(value / 10**exponent)
    if first == 10:
        first, exponent = 1, exponent + 1
    power = "10" + str(exponent).translate(_POWERS)
    return power if first == 1 else f"{first}·{power}"


def rounded(value: float) -> str:
    """Two significant digits without an exponent; whole numbers of more digits as they are."""
    if value >= 100:
        return f"{value:.0f}"
    return f"{float(f'{value:.2g}'):g}"


def percent(part: float) -> str:
    """A part as a percentage of two significant digits."""
    return f"{rounded(100 * part)} %"
