"""Linearity error of EMVA 1288 by its definition, from levels without noise."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.calibration.level_series import LevelSeries
from analysis.calibration.linearity_error import linearity_error
from tests.support.calibration.sensor_model import Array


def levels(counts: Array) -> LevelSeries:
    size = counts.size
    return LevelSeries(
        exposure_s=np.linspace(1, 100, size), mean_dn=counts, variance_dn2=np.ones(size),
        scatter_dn2=np.zeros(size), frames=np.full(size, 2.0), age_s=np.zeros(size), pixels=100,
    )  # fmt: skip


def test_a_line_with_an_offset_has_no_error() -> None:
    lit = levels(10 + 40.0 * np.linspace(1, 100, 60))
    assert linearity_error(lit, np.full(60, 8.0), 59) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_a_bend_has_the_error_of_the_weighted_line() -> None:
    """The minimum over lines of the sum of squared relative deviations, found by brute force."""
    light = np.linspace(1, 100, 60)
    lit = levels(40.0 * light * (1 - 1e-4 * light))
    error = linearity_error(lit, np.zeros(60), 59)
    inside = (lit.mean_dn >= 0.05 * lit.mean_dn[-1]) & (lit.mean_dn <= 0.95 * lit.mean_dn[-1])
    x, y = light[inside], lit.mean_dn[inside]

    def cost(slope: float, offset: float) -> float:
        return float(np.sum(((y - slope * x - offset) / y) ** 2))

    slopes, offsets = np.linspace(39.4, 40.0, 61), np.linspace(-2.0, 6.0, 81)
    slope, offset = min(((a, b) for a in slopes for b in offsets), key=lambda line: cost(*line))
    deviation = 100 * (y / (slope * x + offset) - 1)
    assert error == pytest.approx((deviation.min(), deviation.max()), abs=0.02)
    assert error.least_percent < -0.1
