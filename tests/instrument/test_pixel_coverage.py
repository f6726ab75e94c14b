"""Exact coverage of pixels by a polygon."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from instrument.pixel_coverage import polygon_coverage

COORDINATE = st.floats(-40, 140, allow_nan=False)
TRIANGLE = st.lists(st.tuples(COORDINATE, COORDINATE), min_size=3, max_size=3).map(np.array)


def _area(polygon: np.ndarray) -> float:
    x, y = polygon.T
    return float(abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2)


def test_a_rectangle_on_pixel_borders_covers_whole_pixels() -> None:
    # Pixel n covers n - 1/2 to n + 1/2.
    square = np.array([[1.5, 2.5], [4.5, 2.5], [4.5, 4.5], [1.5, 4.5]])
    coverage = polygon_coverage(square, 10, 10)
    assert coverage.inside_frame
    assert coverage.crop == (slice(3, 5), slice(2, 5))
    assert np.array_equal(coverage.fraction, np.ones((2, 3)))


def test_a_pixel_cut_along_its_diagonal_counts_half() -> None:
    coverage = polygon_coverage(np.array([[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5]]), 4, 4)
    assert coverage.fraction == pytest.approx(np.array([[0.5]]))


@given(TRIANGLE)
def test_the_fractions_add_up_to_the_area_inside_a_wide_frame(triangle: np.ndarray) -> None:
    coverage = polygon_coverage(triangle + 50, 300, 300)
    assert coverage.fraction.sum() == pytest.approx(_area(triangle), abs=1e-7)
    assert np.all((coverage.fraction >= 0) & (coverage.fraction <= 1))


@given(TRIANGLE)
def test_the_frame_only_cuts_it_changes_nothing_inside(triangle: np.ndarray) -> None:
    whole = polygon_coverage(triangle + 50, 300, 300)
    picture = np.zeros((300, 300))
    picture[whole.crop] = whole.fraction
    cut = polygon_coverage(triangle, 100, 80)
    seen = np.zeros((80, 100))
    seen[cut.crop] = cut.fraction
    np.testing.assert_allclose(seen, picture[50:130, 50:150], rtol=0, atol=1e-9)


def test_a_polygon_outside_covers_nothing() -> None:
    coverage = polygon_coverage(np.array([[200.0, 10], [220, 10], [220, 40]]), 100, 80)
    assert coverage.fraction.sum() == 0
    assert not coverage.inside_frame
