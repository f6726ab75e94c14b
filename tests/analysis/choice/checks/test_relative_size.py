"""Relative sizes: quotients wherever they exist, and no warning anywhere."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from analysis.choice.checks.relative_size import relative_size

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
NORMAL = st.floats(1e-100, 1e100)


@given(NUMBERS, NUMBERS)
def test_any_two_finite_numbers_have_one(size: float, value: float) -> None:
    (found,) = relative_size(np.array([size]), np.array([value]))
    assert found >= 0
    assert size != 0 or found == 0
    assert value != 0 or size == 0 or found > 1e-16  # the smallest over the smallest normal number


@given(NORMAL, NORMAL, st.sampled_from([-1, 1]), st.sampled_from([-1, 1]))
def test_it_is_the_quotient_without_signs(a: float, b: float, one: int, other: int) -> None:
    (found,) = relative_size(np.array([one * a]), np.array([other * b]))
    assert math.isclose(found * b, a)


def test_a_value_of_next_to_nothing_is_infinitely_far_below_a_usual_one() -> None:
    assert relative_size(np.array([100.0]), np.array([1e-310])).tolist() == [math.inf]
