"""The trapezoid of speed: limits and continuity."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from instrument.kinematics import Trapezoid

DISTANCE = st.floats(-180, 180).filter(lambda d: abs(d) > 1e-6)
RATE = st.floats(0.1, 200)


def test_a_long_move_cruises_and_a_short_one_does_not() -> None:
    # 20 deg/s at 40 deg/s^2: 0.5 s and 5 deg for each ramp.
    assert Trapezoid(50.0, 20.0, 40.0).duration_s == pytest.approx(0.5 + 2.0 + 0.5)
    assert Trapezoid(2.5, 20.0, 40.0).duration_s == pytest.approx(0.5)
    assert Trapezoid(0.0, 20.0, 40.0).duration_s == 0.0


def test_a_way_too_short_for_a_floats_root_takes_no_time() -> None:
    least = Trapezoid(5e-324, 20.0, 40.0)  # the smallest float there is
    assert least.duration_s == 0.0
    assert least.travelled_deg(1.0) == 0.0


@given(DISTANCE, RATE, RATE)
def test_it_starts_at_rest_ends_at_the_target_and_never_exceeds_its_speed(
    distance: float, speed: float, acceleration: float
) -> None:
    move = Trapezoid(distance, speed, acceleration)
    end_s = move.duration_s
    assert move.travelled_deg(0.0) == 0.0
    assert move.travelled_deg(end_s) == pytest.approx(distance)
    assert move.travelled_deg(end_s / 2) == pytest.approx(distance / 2)
    way = [abs(move.travelled_deg(end_s * n / 50)) for n in range(51)]
    steps = [b - a for a, b in pairwise(way)]
    assert min(steps) >= -1e-9
    assert max(steps) <= speed * end_s / 50 * (1 + 1e-6)
