"""Oren and Nayar's functional form with a weight of its interreflection."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.data.measurements import Measurements
from analysis.fit.fit import fit
from analysis.models import MODELS
from instrument.geometry import Geometry

MODEL = MODELS["oren_nayar_weighted"]
PLAIN = MODELS["oren_nayar"]
RNG = np.random.default_rng(34)


def _drawn(number: int = 200) -> Geometry:
    theta_i, theta_r = RNG.uniform(0, 85, (2, number))
    return Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=RNG.uniform(0, 360, number))


@pytest.mark.parametrize(("albedo", "sigma"), RNG.uniform((0, 0), (1, 60), (8, 2)).tolist())
def test_the_weight_scales_what_rises_as_the_square_of_the_albedo(
    albedo: float, sigma: float
) -> None:
    at = _drawn()
    whole = PLAIN.brdf(at, albedo=albedo, sigma_deg=sigma)
    direct = albedo * 1e9 * PLAIN.brdf(at, albedo=1e-9, sigma_deg=sigma)
    for weight in (0.0, 1.0, 2.5):
        found = MODEL.brdf(at, albedo=albedo, sigma_deg=sigma, interreflection=weight)
        expected = direct + weight * (whole - direct)
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("weight", RNG.uniform(0.3, 2.5, 3).tolist())
def test_a_fit_finds_the_weight(weight: float) -> None:
    """Six incidences in two planes; noise of 0.1 %."""
    truth = {"albedo": 0.85, "sigma_deg": 45.0, "interreflection": weight}
    theta_i, theta_r, dphi = (
        a.ravel() for a in np.meshgrid([0, 15, 30, 45, 60, 70], np.linspace(-70, 70, 29), [0, 60])
    )
    at = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    brdf = MODEL.brdf(at, **truth)
    noisy = brdf * (1 + 1e-3 * RNG.standard_normal(brdf.size))
    found = fit(MODEL, Measurements.bare(theta_i, theta_r, dphi, noisy, 1e-3 * brdf))
    for name, value in truth.items():
        assert abs(found.values[name] - value) < 5 * found.u[name]
    assert found.u["interreflection"] < 0.3
