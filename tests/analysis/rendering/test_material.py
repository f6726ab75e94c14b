"""Materials: tables of costly models, and Lambert's law of the same albedo."""

import numpy as np
import pytest

from analysis.models import MODELS
from analysis.rendering.light import light
from analysis.rendering.material import Material
from analysis.rendering.render import render
from analysis.rendering.shapes import sphere
from instrument.geometry import Geometry

RNG = np.random.default_rng(232)
CLAY = Material.named("oren_nayar_exact", albedo=0.7, sigma_deg=40.0)


def test_tables_of_costly_models_show_what_the_model_says() -> None:
    surface, lamp = sphere(62), [light(float(RNG.uniform(0, 80)), 30)]
    table, each = render(surface, CLAY, lamp), render(surface, CLAY.brdf, lamp)
    off = np.abs(table - each)[np.isfinite(each)]
    assert np.max(off) < 0.01 * np.nanmax(each)
    assert np.median(off) < 0.002 * np.nanmax(each)


def test_lambert_beside_a_material_has_its_albedo_or_its_reflectance() -> None:
    """Of a model without an albedo the share that is reflected, by the trapezoidal rule."""
    assert CLAY.albedo == 0.7
    wolff = Material.named("wolff", single_scattering_albedo=0.95, n=1.5)
    theta = np.linspace(0, np.pi / 2, 20_001)
    at = Geometry.from_degrees(theta_i=0.0, theta_r=np.degrees(theta))
    brdf = MODELS["wolff"].brdf(at, single_scattering_albedo=0.95, n=1.5)
    share = np.trapezoid(brdf * np.cos(theta) * 2 * np.pi * np.sin(theta), theta)
    assert wolff.albedo == pytest.approx(share, rel=1e-4)
    assert wolff.lambert(at) == pytest.approx(np.full(at.shape, share / np.pi), rel=1e-4)


def test_a_narrow_lobe_has_its_whole_reflectance() -> None:
    """Of a spike alone: its BRDF times the cosine is a Gaussian of unit volume at the normal."""
    spike = Material.named("unified", diffuse=0.0, lobe=0.0, sigma_deg=5.0, spike=0.3,
                           spike_width_deg=0.5)  # fmt: skip
    assert spike.albedo == pytest.approx(0.3, rel=0.01)
