"""Limits and truncated sums of Beckmann and Spizzichino's lobe."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.benchmark.maps.beckmann_lobe import TERMS, first_terms_brdf, lobe_sums
from analysis.models.specular.beckmann_spizzichino import (
    lobe_brdf,
    lobe_exponent,
    lobe_factor,
    optical_roughness,
    rough_lobe_brdf,
    smooth_lobe_brdf,
)
from analysis.models.specular.poisson_sums import poisson_sum
from tests.support.models.method_scenes import angles


@settings(max_examples=20)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 100),
    ln_sigma_h=st.floats(np.log(1e-2), np.log(100.0)),
    ln_T=st.floats(np.log(0.1), np.log(1000.0)),
)  # fmt: skip
def test_error_of_a_truncated_sum_is_bounded_by_the_rest_of_its_poisson_weights(
    seed: int, count: int, ln_sigma_h: float, ln_T: float
) -> None:
    """All terms are positive and e^(-q/m)/m <= 1, so the error is P(m > count) at the most."""
    from scipy.stats import poisson

    geometry, sigma_h, T = (
        angles(np.random.default_rng(seed), 100),
        np.exp(ln_sigma_h),
        np.exp(ln_T),
    )
    missing = lobe_brdf(geometry, 2.0, sigma_h, T) - first_terms_brdf(
        geometry, 2.0, sigma_h, T, count
    )
    most = 2.0 * lobe_factor(geometry, T)
    rounding = 1e-9 * most
    assert np.all(missing >= -rounding)
    assert np.all(
        missing <= most * poisson.sf(count, optical_roughness(geometry, sigma_h)) + rounding
    )


def test_sums_are_those_of_the_limits_and_of_the_first_terms() -> None:
    geometry = angles(np.random.default_rng(1), 100)
    sigma_h, T = 0.3, 3.0
    g, q = optical_roughness(geometry, sigma_h), lobe_exponent(geometry, T)
    smooth, rough, *truncated = (lobe_factor(geometry, T) * s for s in lobe_sums(g, q))
    np.testing.assert_allclose(smooth, smooth_lobe_brdf(geometry, 1.0, sigma_h, T), rtol=1e-12)
    np.testing.assert_allclose(rough, rough_lobe_brdf(geometry, 1.0, sigma_h, T), rtol=1e-12)
    for count, found in zip(TERMS, truncated, strict=True):
        expected = first_terms_brdf(geometry, 1.0, sigma_h, T, count)
        np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize(("g", "nearest"), [(1e-3, 0), (1e4, 1), (3.0, 2), (60.0, 3)])
def test_each_sum_is_right_in_its_own_region(g: float, nearest: int) -> None:
    """In the mirror direction, where q = 0: within 0.2 %, the others worse or no better."""
    here, zero = np.array([g]), np.zeros(1)
    exact = poisson_sum(here, zero, lambda m, *_: 1 / m)
    off = [abs(float(s[0] / exact[0] - 1)) for s in lobe_sums(here, zero)]
    assert off[nearest] < 2e-3
    assert off[nearest] <= off[0 if nearest else 1]
