"""Wolff's combination with Oren and Nayar: printed formula, limits, transition range."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.models import MODELS
from analysis.models.smooth.fresnel import unpolarised, wolff_polynomial
from analysis.models.smooth.wolff_oren_nayar import (
    TRANSITION_DEG,
    roughness_share,
    wolff_oren_nayar_brdf,
)
from instrument.geometry import Geometry


def printed_combination(
    i: float, r: float, dphi: float, rho: float, s: float, n: float
) -> float:  # fmt: skip
    """1998 (3) with C1 of (9), without (4), typed from the paper; angles in radians."""
    a, b, c, s2 = max(i, r), min(i, r), math.cos(dphi), s * s
    c1 = 1 - 0.5 * s2 / (s2 + 0.33)
    c1 *= 1 - float(unpolarised(i, n))
    c1 *= 1 - float(unpolarised(math.asin(math.sin(r) / n), 1 / n))
    c2 = 0.45 * s2 / (s2 + 0.09) * (math.sin(a) - (0 if c >= 0 else (2 * b / math.pi) ** 3))
    c3 = 0.125 * s2 / (s2 + 0.09) * (4 * a * b / math.pi**2) ** 2
    bracket = c1 + c * c2 * math.tan(b) + (1 - abs(c)) * c3 * math.tan((a + b) / 2)
    return rho / math.pi * bracket


@pytest.mark.parametrize("dphi", [0.0, 70.0, 120.0, 180.0])
@pytest.mark.parametrize("sigma", [0.0, 5.0, 20.0, 50.0])
def test_the_printed_formula(sigma: float, dphi: float) -> None:
    for i, r in ((0.0, 0.0), (30.0, 60.0), (75.0, 40.0), (80.0, 80.0)):
        geometry = Geometry.from_degrees(theta_i=i, theta_r=r, dphi=dphi)
        found = MODELS["wolff_oren_nayar"].brdf(geometry, albedo=0.7, sigma_deg=sigma, n=1.6)
        expected = printed_combination(
            *map(math.radians, (i, r, dphi)), 0.7, math.radians(sigma), 1.6
        )
        assert found == pytest.approx(expected, rel=1e-11, abs=1e-13)


@pytest.mark.parametrize("epsilon", [0.0, 0.07, 0.2])
def test_equation_9_with_the_polynomial(epsilon: float) -> None:
    geometry = Geometry.from_degrees(theta_i=[0.0, 50, 70, 90], theta_r=[0.0, 50, 70, 30], dphi=90)
    share = np.ones(4)
    for theta in (geometry.theta_i, geometry.theta_r):
        share = share * (1 - wolff_polynomial(theta, epsilon))
    smooth = wolff_oren_nayar_brdf(geometry, 0.6, 0.0, 1.5, epsilon)
    np.testing.assert_allclose(smooth, 0.6 / np.pi * share, rtol=1e-12, atol=1e-16)


def test_without_an_interface_it_is_the_functional_form_without_interreflection() -> None:
    geometry = Geometry.from_degrees(theta_i=50, theta_r=[-70, 0, 70], dphi=20)
    found = MODELS["wolff_oren_nayar"].brdf(geometry, albedo=0.5, sigma_deg=20, n=1.0)
    dark = MODELS["oren_nayar"].brdf(geometry, albedo=1e-9, sigma_deg=20) * 0.5e9
    np.testing.assert_allclose(found, dark, rtol=1e-8)


@pytest.mark.parametrize(
    ("sigma_deg", "ratio"), [(2.5, 100), (6, 20), (9, 10), (17, 4), (22, 3), (36, 2)]
)
def test_the_transition_range_as_the_authors_read_it(sigma_deg: float, ratio: float) -> None:
    # 1998, section 4 and figure 16
    assert 1 / roughness_share(sigma_deg) == pytest.approx(ratio, rel=0.07)
    assert sigma_deg not in TRANSITION_DEG or ratio in (10, 2)


def test_limits_of_validity() -> None:
    model = MODELS["wolff_oren_nayar"]
    geometry = Geometry.from_degrees(theta_i=85, theta_r=[-85, 0, 85])
    inside = model.validity(geometry, albedo=0.5, sigma_deg=20, n=1.5)
    assert list(inside.mask) == [False, True, True]
    assert "negative" in inside.reason
    assert np.all((model.brdf(geometry, albedo=0.5, sigma_deg=20, n=1.5) >= 0) == inside.mask)
    above = model.validity(geometry, albedo=0.5, sigma_deg=37, n=1.5)
    assert not above.mask.any()
    assert "36 degrees" in above.reason
