"""Facets by Wolff under the integral: its limits, which other models compute in other ways."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.models.rough.oren_nayar_exact import oren_nayar_exact_brdf
from analysis.models.smooth.wolff_facets import wolff_facets_brdf
from analysis.models.smooth.wolff_oren_nayar import wolff_oren_nayar_brdf
from instrument.geometry import Geometry

RNG = np.random.default_rng(1998)


def _drawn(number: int, most_deg: float = 80.0) -> Geometry:
    theta_i, theta_r = RNG.uniform(0, most_deg, (2, number))
    return Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=RNG.uniform(0, 360, number))


@pytest.mark.parametrize("sigma", RNG.uniform(2, 60, 6).tolist())
def test_without_an_interface_it_is_the_rough_surface_in_direct_light(sigma: float) -> None:
    at = _drawn(60)
    direct = oren_nayar_exact_brdf(at, 1e-12, sigma) * (0.8 / 1e-12)
    np.testing.assert_allclose(wolff_facets_brdf(at, 0.8, sigma, 1.0), direct, rtol=5e-4)


@pytest.mark.parametrize("n", RNG.uniform(1, 2.5, 4).tolist())
def test_without_roughness_it_is_the_smooth_surface(n: float) -> None:
    at = _drawn(40, 75.0)
    smooth = wolff_oren_nayar_brdf(at, 0.7, 0.0, n)
    np.testing.assert_allclose(wolff_facets_brdf(at, 0.7, 0.2, n), smooth, rtol=1e-3)


def test_it_is_reciprocal_and_does_not_depend_on_the_sign_of_the_azimuth() -> None:
    at = _drawn(40)
    exchanged = Geometry(at.theta_r_deg, at.theta_i_deg, at.dphi_deg)
    mirrored = Geometry(at.theta_i_deg, at.theta_r_deg, 360 - at.dphi_deg)
    found = wolff_facets_brdf(at, 0.7, 25.0, 1.5)
    for other in (exchanged, mirrored):
        np.testing.assert_allclose(wolff_facets_brdf(other, 0.7, 25.0, 1.5), found, rtol=2e-3)
