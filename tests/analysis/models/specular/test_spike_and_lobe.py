"""Spike and lobe of one surface: they share the light as its roughness says."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.data.measurements import Measurements
from analysis.fit.fit import fit
from analysis.models import MODELS
from instrument.geometry import Geometry

MODEL = MODELS["spike_and_lobe"]
RNG = np.random.default_rng(20)


def _about_the_mirror(theta_i: float, reach_deg: float) -> tuple[Geometry, np.ndarray]:
    """Directions about the mirror direction, and the solid angle times cos(theta_r) of each."""
    theta_r = np.linspace(max(theta_i - reach_deg, 0.0), theta_i + reach_deg, 301)
    dphi = 180 + np.linspace(-180, 180, 721)[:-1] * min(1.0, 3 * reach_deg / (theta_i + 5))
    angles = np.meshgrid(theta_r, dphi, indexing="ij")
    at = Geometry.from_degrees(theta_i=theta_i, theta_r=angles[0], dphi=angles[1])
    r = np.radians(angles[0])
    cell = np.radians(theta_r[1] - theta_r[0]) * np.radians(dphi[1] - dphi[0])
    return at, np.sin(r) * np.cos(r) * cell


@pytest.mark.parametrize("sigma_h", [0.01, 0.05, 0.1, 0.2, 1.0])
def test_spike_and_lobe_together_reflect_the_scale(sigma_h: float) -> None:
    """Whatever the height: what leaves the spike is in the lobe (gentle slopes, 30 degrees)."""
    at, weight = _about_the_mirror(30.0, 25.0)
    length = max(60 * sigma_h, 6.0)
    brdf = MODEL.brdf(
        at, scale=0.8, sigma_h=sigma_h, correlation_length=length, spike_width_deg=1.0
    )
    assert np.sum(brdf * weight) == pytest.approx(0.8, rel=0.02)


@pytest.mark.parametrize("theta", RNG.uniform(0, 75, 6).tolist())
def test_the_spike_fades_with_the_roughness_as_printed(theta: float) -> None:
    """e^-g with (19), on top of the lobe, in the mirror direction."""
    at = Geometry.from_degrees(theta_i=theta, theta_r=theta, dphi=180.0)
    lobe = MODELS["beckmann_spizzichino"]
    for sigma_h in (0.002, 0.025, 0.1):
        surface = {"scale": 0.5, "sigma_h": sigma_h, "correlation_length": 20.0}
        spike = MODEL.brdf(at, **surface, spike_width_deg=0.5) - lobe.brdf(at, **surface)
        g = (2 * math.pi * sigma_h * 2 * math.cos(math.radians(theta))) ** 2
        w = math.radians(0.5)
        expected = 0.5 * math.exp(-g) / (2 * math.pi * w * w * math.cos(math.radians(theta)))
        assert spike == pytest.approx(expected, rel=1e-9)


def test_a_fit_tells_height_and_length_apart_where_both_components_show() -> None:
    truth = {"scale": 0.6, "sigma_h": 0.12, "correlation_length": 8.0, "spike_width_deg": 1.2}
    theta_i, off = (a.ravel() for a in np.meshgrid([20.0, 40.0, 55.0], np.linspace(-15, 15, 61)))
    brdf = MODEL.brdf(Geometry.from_degrees(theta_i=theta_i, theta_r=-theta_i - off), **truth)
    noisy = brdf * (1 + 2e-3 * RNG.standard_normal(brdf.size))
    found = fit(MODEL, Measurements.bare(theta_i, -theta_i - off, 0.0, noisy, 2e-3 * brdf))
    for name, value in truth.items():
        assert abs(found.values[name] - value) < 5 * found.u[name], name
    assert found.u["sigma_h"] < 0.01
