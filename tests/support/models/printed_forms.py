"""Oren and Nayar's printed formulas, typed from the paper."""

from __future__ import annotations

import math


def printed_functional(i: float, r: float, dphi: float, rho: float, sigma: float) -> float:
    """1995 (33) + (34) over E0 cos(theta_i), typed from the paper; angles in radians."""
    a, b, c, s2 = max(i, r), min(i, r), math.cos(dphi), sigma**2
    c1 = 1 - 0.5 * s2 / (s2 + 0.33)
    c2 = 0.45 * s2 / (s2 + 0.09) * (math.sin(a) - (0 if c >= 0 else (2 * b / math.pi) ** 3))
    c3 = 0.125 * (s2 / (s2 + 0.09)) * (4 * a * b / math.pi**2) ** 2
    l1 = rho / math.pi * (c1 + c * c2 * math.tan(b) + (1 - abs(c)) * c3 * math.tan((a + b) / 2))
    l2 = 0.17 * rho**2 / math.pi * s2 / (s2 + 0.13) * (1 - c * (2 * b / math.pi) ** 2)
    return l1 + l2


def printed_qualitative(i: float, r: float, dphi: float, rho: float, sigma: float) -> float:
    """1995 (36) over E0 cos(theta_i), typed from the paper; angles in radians."""
    s2 = sigma**2
    big_a, big_b = 1.0 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)
    lobe = max(0.0, math.cos(dphi)) * math.sin(max(i, r)) * math.tan(min(i, r))
    return rho / math.pi * (big_a + big_b * lobe)
