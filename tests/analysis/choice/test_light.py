"""Presence of light in a table."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.choice.light import require_light
from analysis.data.measurements import Measurements
from instrument.errors import NotDetermined


def table(*values: float) -> Measurements:
    return Measurements.bare(30.0, np.linspace(-80.0, 80.0, len(values)), 0.0, np.array(values))


@pytest.mark.parametrize(
    "values",
    [(0.0, 0.0), (0.0,), (-1e-3, 1e-3, 5e-4, -5e-4), (1e-300, 1e-200), (-0.2, -0.3), (1.0, -1.0)],
)
def test_nothing_but_noise_about_zero(values: tuple[float, ...]) -> None:
    with pytest.raises(NotDetermined, match=r"^no light in this table: mean value"):
        require_light(table(*values))


@pytest.mark.parametrize(
    "values", [(0.2,), (1e-9, 0.0), (10.0, 1e-4, -1e-4, 1e-4, -1e-4), (1e15, 1e-300)]
)
def test_a_single_lit_point_is_light(values: tuple[float, ...]) -> None:
    require_light(table(*values))


@given(st.integers(0, 2**32), st.integers(2, 200), st.floats(-12.0, 12.0))
def test_the_answer_does_not_depend_on_the_unit(seed: int, n: int, power: float) -> None:
    values = np.random.default_rng(seed).normal(0.2, 1.0, n)
    assert _lit(values) == _lit(values * 10.0**power)


@pytest.mark.slow
def test_noise_is_rarely_light_and_light_of_its_own_size_always(slow: bool) -> None:
    rng = np.random.default_rng(5)
    count = 2000 if slow else 500
    noise = rng.standard_normal((count, 40))
    false = sum(_lit(row) for row in noise)
    assert false < (
        40 if slow else 15
    )  # 1.1 %: beyond 3 standard deviations as estimated from 20 negative values
    assert all(_lit(row + 2.0) for row in noise)


def _lit(values: np.ndarray) -> bool:
    try:
        require_light(table(*values))
    except NotDetermined:
        return False
    return True
