"""Every method's stated error bound holds over its ranges, and its stated cost holds too."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.models.rough.oren_nayar_exact import clear_profile_cache
from analysis.models.smooth import wolff
from instrument.geometry import Geometry
from tests.support.cpu_time import cpu_seconds
from tests.support.models.method_scenes import FAMILIES, angles, drawn_ranges, within


@pytest.mark.parametrize("name", FAMILIES)
@settings(max_examples=12)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_method_exceeds_its_error_bound(name: str, seed: int) -> None:
    family, random = FAMILIES[name], np.random.default_rng(seed)
    geometry = angles(random, 60 if name == "rough" else 300)
    ranges = drawn_ranges(random, family)
    bounds = {m.name: m.bound(geometry, ranges) for m in family.methods}
    for _ in range(3):
        values = within(random, ranges)
        exact = family.reference.kernel(geometry, **values)
        for method in family.methods[:-1]:
            off = np.abs(family.relative_error(method.kernel(geometry, **values), exact))
            allowed = bounds[method.name] * (1 + 1e-9) + family.accuracy(geometry)
            worst = np.argmax(off - allowed)
            assert np.all(off <= allowed), (method.name, values, off[worst], allowed[worst])


SCENE = np.random.default_rng(5).uniform(0, 80, (2, 2000))


def fresh() -> Geometry:
    """A scene of which nothing is cached."""
    return Geometry.from_degrees(theta_i=SCENE[0], theta_r=SCENE[1], dphi=90.0)


@pytest.mark.parametrize(
    ("name", "method", "other", "values"),
    [
        ("rough", "table", "functional", {"albedo": 0.8, "sigma_deg": 20.0}),
        ("rough", "coarse", "table", {"albedo": 0.8, "sigma_deg": 20.0}),
        ("rough", "exact", "coarse", {"albedo": 0.8, "sigma_deg": 20.0}),
        ("smooth", "order 4", "exact", {"single_scattering_albedo": 0.9, "n": 1.5}),
        ("lobe", "10 terms", "rough", {"scale": 1.0, "sigma_h": 0.3, "correlation_length": 3.0}),
        ("lobe", "adaptive", "10 terms",
         {"scale": 1.0, "sigma_h": 0.3, "correlation_length": 3.0}),
    ],
)  # fmt: skip
def test_stated_costs_agree_with_measured_times(
    name: str, method: str, other: str, values: dict[str, float]
) -> None:
    """The ratio of two methods' times in one run, within a factor of 2.5 either way."""
    family = FAMILIES[name]
    ranges = {parameter: (value, value) for parameter, value in values.items()}

    def seconds(chosen: str) -> float:
        def once() -> None:
            clear_profile_cache()
            wolff._h_and_k_series.cache_clear()  # a fit changes the parameters each time
            family[chosen].kernel(fresh(), **values)

        return cpu_seconds(once, 3 if chosen in ("coarse", "exact") and name == "rough" else 9)

    def cost(chosen: str) -> float:
        return family[chosen].cost(fresh(), ranges).of(2000)

    ratio = (seconds(method) / seconds(other)) / (cost(method) / cost(other))
    assert 1 / 2.5 < ratio < 2.5
