"""Choice among the methods of the smooth dielectric."""

from __future__ import annotations

import numpy as np

from acquisition.benchmark.maps.smooth_dielectric import SMOOTH_DIELECTRIC
from analysis.accuracy.cheapest import cheapest
from tests.support.models.method_scenes import angles


def test_a_low_order_saves_time_for_few_geometries_only() -> None:
    """An order saves part of making a series, which is negligible for many geometries."""
    random = np.random.default_rng(1)
    ranges = {"single_scattering_albedo": (0.5, 0.9), "n": (1.3, 1.7)}
    few = cheapest(SMOOTH_DIELECTRIC, angles(random, 50, 70.0), ranges, 0.1)
    assert few.method.startswith("order")
    assert few.cost_of_best < 1.4 * few.cost
    assert cheapest(SMOOTH_DIELECTRIC, angles(random, 50, 70.0), ranges, 1e-5).method == "exact"
    many = cheapest(SMOOTH_DIELECTRIC, angles(random, 20_000, 70.0), ranges, 0.1)
    assert many.cost_of_best < 1.05 * many.cost
