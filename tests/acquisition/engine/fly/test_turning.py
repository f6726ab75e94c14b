"""Angle of a moving frame from the samples about it."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.engine.fly.turning import Sample, Shot
from instrument.devices import Frame

IMAGE = np.zeros((1, 1), np.uint8)


def shot(exposure_s: float, end_s: float, stamp_s: float | None, turned_deg: float) -> Shot:
    frame = Frame(IMAGE, exposure_s, end_s, stamp_s)
    return Shot(frame, Sample(10.0, 0.0, 0.001), Sample(10.0 + turned_deg, 0.5, 0.002), -4.0)


def test_the_angle_is_that_at_the_middle_of_the_exposure() -> None:
    taken = shot(0.1, 0.45, None, -2.0)
    assert taken.middle_s == pytest.approx(0.4)
    assert taken.reported_deg == pytest.approx(10.0 - 0.4 * 4.0)
    assert taken.blur_deg == pytest.approx(0.4)
    assert taken.u_deg == pytest.approx(0.008)


def test_the_camera_s_own_time_stamp_counts_where_there_is_one() -> None:
    assert shot(0.1, 0.45, 0.3, -2.0).reported_deg == pytest.approx(10.0 - 0.25 * 4.0)


def test_a_turn_that_is_not_the_one_commanded_is_seen() -> None:
    assert shot(0.1, 0.45, None, -2.0).is_even(0.01)
    assert shot(0.1, 0.45, None, -2.15).is_even(0.01)  # a tenth of 2 deg, and the u of times
    for turned_deg in (-1.5, -2.5, 0.0, 2.0):
        assert not shot(0.1, 0.45, None, turned_deg).is_even(0.01)
        assert shot(0.1, 0.45, None, turned_deg).is_even(5.0)
