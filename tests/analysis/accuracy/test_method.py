"""Every method's stated error bound holds over its ranges, and its stated cost holds too."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.accuracy.method import relative_error
from analysis.accuracy.rough_surface import ROUGH_SURFACE
from analysis.models.rough.oren_nayar_exact import clear_profile_cache
from instrument.geometry import Geometry
from tests.support.models.method_scenes import angles, drawn_ranges, within
from tests.support.timing.cpu_time import cpu_seconds


@settings(max_examples=12)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_method_exceeds_its_error_bound(seed: int) -> None:
    family, random = ROUGH_SURFACE, np.random.default_rng(seed)
    geometry = angles(random, 60)
    ranges = drawn_ranges(random, family.parameters)
    bounds = {m.name: m.bound(geometry, ranges) for m in family.methods}
    for _ in range(3):
        values = within(random, ranges)
        exact = family.reference.kernel(geometry, **values)
        for method in family.methods[:-1]:
            off = np.abs(relative_error(method.kernel(geometry, **values), exact))
            allowed = bounds[method.name] * (1 + 1e-9) + family.accuracy(geometry)
            worst = np.argmax(off - allowed)
            assert np.all(off <= allowed), (method.name, values, off[worst], allowed[worst])


def test_relative_error_where_the_reference_is_zero() -> None:
    found = relative_error(np.array([0.0, 1.0, 3.0]), np.array([0.0, 0.0, 2.0]))
    assert found.tolist() == [0.0, np.inf, 0.5]


SCENE = np.random.default_rng(5).uniform(0, 80, (2, 2000))


def fresh() -> Geometry:
    """A scene of which nothing is cached."""
    return Geometry.from_degrees(theta_i=SCENE[0], theta_r=SCENE[1], dphi=90.0)


@pytest.mark.parametrize(
    ("method", "other"), [("table", "functional"), ("coarse", "table"), ("exact", "coarse")]
)
def test_stated_costs_agree_with_measured_times(method: str, other: str) -> None:
    """The ratio of two methods' times in one run, within a factor of 2.5 either way."""

    def seconds(chosen: str) -> float:
        def once() -> None:
            clear_profile_cache()
            ROUGH_SURFACE[chosen].kernel(fresh(), albedo=0.8, sigma_deg=20.0)

        return cpu_seconds(once, 3 if chosen in ("coarse", "exact") else 9)

    def cost(chosen: str) -> float:
        return ROUGH_SURFACE[chosen].cost.of(2000)

    ratio = (seconds(method) / seconds(other)) / (cost(method) / cost(other))
    assert 1 / 2.5 < ratio < 2.5
