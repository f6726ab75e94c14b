"""Statistics of a random height field: equivalent slopes, thresholds, refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.models.specular.beckmann_spizzichino import lobe_brdf, rough_lobe_brdf
from analysis.models.specular.surface_statistics import (
    curvature_radius,
    has_gaussian_lobe,
    has_lobe,
    has_spike,
    has_spike_like_lobe,
    height_over_length,
    slope_scale,
    slope_sigma_deg,
    unshadowed_deg,
)
from analysis.models.specular.torrance_sparrow import half_vector
from instrument.geometry import Geometry


def test_equation_60_links_heights_and_slopes() -> None:
    # 1991 (60): alpha_0 = atan(0.2) = 11.30993 degrees, over sqrt(2)
    assert slope_sigma_deg(0.1, 1.0) == pytest.approx(11.30993 / 1.414214, rel=1e-6)
    assert height_over_length(slope_sigma_deg(0.3, 2.0)) == pytest.approx(0.15, rel=1e-14)
    assert slope_scale(0.3, 2.0) == pytest.approx(0.3)
    assert unshadowed_deg(0.5, 1.0) == pytest.approx(45.0)
    assert unshadowed_deg(0.0, 1.0) == 90.0
    assert curvature_radius(0.0, 1.0) == math.inf
    # the second derivative's variance of exp(-tau^2/T^2): 12 sigma_h^2/T^4
    assert 1 / curvature_radius(0.5, 3.0) == pytest.approx(math.sqrt(12 * 0.25 / 81), rel=1e-14)


def test_equivalent_slopes_give_like_lobes() -> None:
    # Fig. 15: a moving lamp before a fixed camera, sigma_h/T = 0.05; shapes within 1 % of the peak
    geometry = Geometry.from_degrees(theta_i=np.linspace(0, 60, 61), theta_r=30.0, dphi=180.0)
    physical = rough_lobe_brdf(geometry, 1.0, 2.0, 40.0)
    cc = np.cos(geometry.theta_i) * np.cos(geometry.theta_r)
    theta_a, cos_a, _ = half_vector(geometry)
    shape = physical * cc * cos_a**4
    gauss = np.exp(-np.square(theta_a / math.radians(slope_sigma_deg(2.0, 40.0))) / 2)
    np.testing.assert_allclose(shape / shape[30], gauss, atol=0.01)


def test_the_thresholds() -> None:
    assert [has_lobe(s) for s in (0.0, 0.0249, 0.025, 2.0)] == [False, False, True, True]
    assert [has_spike(s) for s in (0.0, 1.5, 1.51)] == [True, True, False]
    assert has_spike_like_lobe(0.19, 10.0)
    assert not has_spike_like_lobe(0.21, 10.0)
    assert has_gaussian_lobe(0.49, 10.0)
    assert not has_gaussian_lobe(0.51, 10.0)


def test_wrong_roughness_is_named() -> None:
    here = Geometry.from_degrees(theta_i=10.0, theta_r=10.0, dphi=180.0)
    with pytest.raises(ValueError, match="sigma_h = -1 wavelengths; allowed: 0 or more"):
        has_spike(-1.0)
    with pytest.raises(ValueError, match="correlation_length = 0 wavelengths; allowed: more than"):
        slope_sigma_deg(1.0, 0.0)
    with pytest.raises(ValueError, match=r"sigma_deg = 70 degrees; allowed: 0 to below 63\.6"):
        height_over_length(70.0)
    with pytest.raises(ValueError, match="sigma_h = 0 wavelengths; allowed: 1e-100 or more"):
        rough_lobe_brdf(here, 1.0, 0.0, 10.0)
    with pytest.raises(ValueError, match="sigma_h = -1 wavelengths; allowed: 0 or more"):
        lobe_brdf(here, 1.0, -1.0, 10.0)
