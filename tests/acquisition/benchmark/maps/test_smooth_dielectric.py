"""Error bounds of the approximations of Wolff's smooth dielectric."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.benchmark.maps.smooth_dielectric import (
    EPSILON,
    ORDERS,
    order_bound,
    polynomial_bound,
)
from analysis.models.smooth.wolff import SINGLE_SCATTERING_ALBEDO, N, wolff_brdf
from tests.support.models.method_scenes import angles, drawn_ranges, within

REFERENCE = 1e-10  # accuracy of the exact model


@settings(max_examples=12)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_approximation_exceeds_its_error_bound(seed: int) -> None:
    random = np.random.default_rng(seed)
    geometry = angles(random, 300)
    ranges = drawn_ranges(random, (SINGLE_SCATTERING_ALBEDO, N))
    bounds = {order: order_bound(order, geometry, ranges) for order in ORDERS}
    polynomial = polynomial_bound(geometry, ranges)
    for _ in range(3):
        values = within(random, ranges)
        exact = wolff_brdf(geometry, **values)
        dark = exact == 0  # there the approximations are 0, too

        def off(
            found: np.ndarray, exact: np.ndarray = exact, dark: np.ndarray = dark
        ) -> np.ndarray:
            assert np.all(found[dark] == 0)
            return np.abs(np.where(dark, 1.0, found) / np.where(dark, 1.0, exact) - 1)

        found = off(wolff_brdf(geometry, **values, epsilon=EPSILON))
        assert np.all(found <= polynomial * (1 + 1e-9) + REFERENCE), values
        for order, bound in bounds.items():
            found = off(wolff_brdf(geometry, **values, order=order))
            assert np.all(found <= bound * (1 + 1e-9) + REFERENCE), (order, values)
