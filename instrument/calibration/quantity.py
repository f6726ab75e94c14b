"""Property that a calibration has found."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """Property with its standard uncertainty; None for both where it was not determined."""

    value: float | None
    u: float | None
    unit: str
    symbol: str
    name: str
