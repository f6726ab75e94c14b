"""Random scenes for the methods of `analysis.accuracy`: angles, ranges and values in them."""

from __future__ import annotations

import numpy as np

from acquisition.benchmark.maps.beckmann_lobe import BECKMANN_LOBE
from acquisition.benchmark.maps.smooth_dielectric import SMOOTH_DIELECTRIC
from analysis.accuracy.method import MethodFamily
from analysis.accuracy.rough_surface import ROUGH_SURFACE
from analysis.models.base import Ranges
from analysis.models.rough.form_error_table import LIMIT_DEG
from instrument.geometry import Geometry

Random = np.random.Generator

FAMILIES = {f.name: f for f in (ROUGH_SURFACE, SMOOTH_DIELECTRIC, BECKMANN_LOBE)}

SPANS: dict[str, tuple[float, float]] = {  # drawn uniformly in the logarithm
    "scale": (1e-3, 10.0),
    "sigma_h": (1e-2, 100.0),
    "correlation_length": (0.1, 1000.0),
}


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


def drawn_ranges(random: Random, family: MethodFamily, points: float = 0.5) -> dict[str, tuple]:
    """A range of each parameter, or, with the probability `points`, a known value."""
    found = {}
    for p in family.parameters:
        geometric = p.name in SPANS
        low, high = np.log(SPANS[p.name]) if geometric else (p.low, p.high)
        half = 0.0 if random.random() < points else random.uniform(0, 0.1 if geometric else 0.3)
        middle = random.uniform(low, high)
        ends = [max(low, middle - half * (high - low)), min(high, middle + half * (high - low))]
        if geometric:  # rounding may lead out of the domain
            ends = [min(max(float(np.exp(e)), p.low), p.high) for e in ends]
        found[p.name] = (float(ends[0]), float(ends[1]))
    return found


def within(random: Random, ranges: Ranges) -> dict[str, float]:
    """Parameters from their ranges, an end as likely as all between."""
    values = {}
    for name, (low, high) in ranges.items():
        value = random.choice([low, high, random.uniform(low, high)])
        values[name] = float(value) if name != "albedo" else max(float(value), 1e-9)
    return values
