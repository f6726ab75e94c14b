"""The tight error bound of the printed forms."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.accuracy.method import relative_error
from analysis.accuracy.rough_surface import ROUGH_SURFACE
from tests.support.models.method_scenes import angles, drawn_ranges, within


@settings(max_examples=8)
@given(seed=st.integers(0, 2**32 - 1))
def test_tight_bound_of_a_form_holds_and_is_tighter(seed: int) -> None:
    family, random = ROUGH_SURFACE, np.random.default_rng(seed)
    geometry, ranges = angles(random, 60), drawn_ranges(random, family.parameters)
    for method in family.methods:
        if method.tight_bound is None:
            continue
        bound, tight = method.bound(geometry, ranges), method.tight_bound(geometry, ranges)
        for _ in range(3):
            values = within(random, ranges)
            exact = family.reference.kernel(geometry, **values)
            off = np.abs(relative_error(method.kernel(geometry, **values), exact))
            assert np.all(off <= tight + 1e-8), (method.name, values)
        if all(low == high for low, high in ranges.values()):
            assert np.median(tight) <= np.median(bound) * 1.01 + 1e-6
