"""Accuracy of the reference method of the rough surface."""

from __future__ import annotations

import numpy as np

from analysis.accuracy.rough_surface import FINE_LIMIT_DEG, ROUGH_SURFACE
from analysis.models.rough.oren_nayar_exact import FINE, Rule, oren_nayar_exact_brdf
from instrument.geometry import Geometry

TWICE = Rule(2 * FINE.slopes, 2 * FINE.per_e, 2 * FINE.azimuths)


def test_the_finest_rule_keeps_its_stated_accuracy_up_to_its_limit() -> None:
    """Against a rule with twice its nodes; nearer to grazing a lower accuracy is stated."""
    random = np.random.default_rng(4)
    for low, high in ((0.0, FINE_LIMIT_DEG), (80.0, FINE_LIMIT_DEG), (FINE_LIMIT_DEG, 90.0)):
        theta_i, theta_r = random.uniform(low, high, (2, 40))
        dphi = random.uniform(0, 360, 40)
        dphi[::4] = 180.0
        geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
        for sigma_deg in (2.0, 20.0, 60.0):
            found, finer = (
                oren_nayar_exact_brdf(geometry, 1.0, sigma_deg, rule) for rule in (FINE, TWICE)
            )
            assert np.all(np.abs(found / finer - 1) <= ROUGH_SURFACE.accuracy(geometry))
