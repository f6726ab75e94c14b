"""Choice among the methods of Beckmann and Spizzichino's lobe."""

from __future__ import annotations

import numpy as np

from acquisition.benchmark.maps.beckmann_lobe import BECKMANN_LOBE
from analysis.accuracy.cheapest import cheapest
from instrument.geometry import Geometry


def test_each_limit_is_chosen_where_it_holds() -> None:
    mirror = Geometry.from_degrees(theta_i=30.0, theta_r=np.linspace(-80, 80, 161))
    very_rough = {"scale": (1.0, 1.0), "sigma_h": (20.0, 20.0), "correlation_length": (200.0,) * 2}
    found = cheapest(BECKMANN_LOBE, mirror, very_rough, 0.01)
    assert found.method == "rough"
    smooth = {**very_rough, "sigma_h": (0.001, 0.001), "correlation_length": (3.0, 3.0)}
    assert cheapest(BECKMANN_LOBE, mirror, smooth, 0.01).method == "smooth"
    between = {**very_rough, "sigma_h": (5.0, 5.0), "correlation_length": (50.0, 50.0)}
    assert cheapest(BECKMANN_LOBE, mirror, between, 1e-6).method == "adaptive"
