"""Random scenes for bounds on errors of methods: angles, ranges and values in them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from analysis.models.base import Parameter, Ranges
from analysis.models.rough.form_error_table import LIMIT_DEG
from instrument.geometry import Geometry

Random = np.random.Generator


def angles(random: Random, count: int, limit_deg: float = LIMIT_DEG) -> Geometry:
    """Directions of all kinds: anywhere, in the plane of incidence, equal, grazing, mirrored."""
    theta_i, theta_r = random.uniform(0, limit_deg, (2, count))
    dphi = random.uniform(0, 360, count)
    kind = random.integers(0, 6, count)
    dphi = np.where(kind == 1, random.choice([0.0, 180.0], count), dphi)
    dphi = np.where(kind == 2, 180 + random.normal(0, 3, count), dphi)
    theta_r = np.where((kind == 2) | (kind == 3), theta_i, theta_r)
    theta_i = np.where(kind == 4, random.uniform(0.85 * limit_deg, limit_deg, count), theta_i)
    return Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)


def drawn_ranges(random: Random, parameters: Iterable[Parameter]) -> dict[str, tuple[float, float]]:
    """A range of each parameter, or, half of the times, a known value."""
    found = {}
    for p in parameters:
        half = 0.0 if random.random() < 0.5 else random.uniform(0, 0.3)
        middle = random.uniform(p.low, p.high)
        ends = (middle - half * (p.high - p.low), middle + half * (p.high - p.low))
        found[p.name] = (max(p.low, ends[0]), min(p.high, ends[1]))
    return found


def within(random: Random, ranges: Ranges) -> dict[str, float]:
    """Parameters from their ranges, an end as likely as all between."""
    values = {}
    for name, (low, high) in ranges.items():
        value = random.choice([low, high, random.uniform(low, high)])
        values[name] = float(value) if name != "albedo" else max(float(value), 1e-9)
    return values
