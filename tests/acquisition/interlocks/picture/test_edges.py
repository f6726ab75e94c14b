"""Edges: found to a fraction of a pixel despite texture and defects; silent where uncertain."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.interlocks.picture.edges import find_edges, outward_normal
from instrument.geometry import FloatArray
from instrument.pixel_coverage import polygon_coverage

SHAPE = (300, 400)
RANGE_DN = (64.0, 3900.0)
EXPECTED = np.array([[100.0, 60], [300, 70], [290, 240], [105, 230]])


def _picture(corners: FloatArray, inside: float = 2500, outside: float = 150) -> FloatArray:
    """A quadrilateral on a darker or brighter table, with noise of 1 % and texture of 3 %."""
    random = np.random.default_rng(0)
    coverage = polygon_coverage(corners, SHAPE[1], SHAPE[0])
    share = np.zeros(SHAPE)
    share[coverage.crop] = coverage.fraction
    blobs = np.kron(random.standard_normal((75, 100)), np.ones((4, 4)))
    light = outside + (inside - outside) * share * (1 + 0.03 * blobs)
    return 64 + light * (1 + 0.01 * random.standard_normal(SHAPE))


def _counts(picture: FloatArray) -> np.ndarray:
    return np.clip(np.rint(picture), 0, 4095).astype(np.uint16)


@pytest.mark.parametrize("moved_px", [(0.0, 0.0), (0.3, -0.4), (7.6, 3.1)])
@pytest.mark.parametrize("levels", [(2500.0, 150.0), (150.0, 2500.0)])
def test_edges_are_found_to_a_fraction_of_a_pixel(
    moved_px: tuple[float, float], levels: tuple[float, float]
) -> None:
    """Bright on dark and dark on bright; hot pixels and a highlight change nothing."""
    picture = _picture(EXPECTED + moved_px, *levels)
    rows, columns = np.random.default_rng(1).integers((20, 20), (280, 380), (200, 2)).T
    picture[rows, columns] = 4095
    picture[100:130, 150:190] *= 1.4
    found = find_edges(_counts(picture), RANGE_DN, EXPECTED, 5.0)
    assert [edge.index for edge in found] == [0, 1, 2, 3]
    for edge in found:
        expected = np.dot(outward_normal(EXPECTED, edge.index), moved_px)
        assert edge.offsets_px == pytest.approx(np.full(2, expected), abs=0.25)


@pytest.mark.parametrize("levels", [(500.0, 500.0), (505.0, 500.0), (6000.0, 4500.0)])
def test_no_contrast_and_no_trusted_counts_are_no_edge(levels: tuple[float, float]) -> None:
    assert find_edges(_counts(_picture(EXPECTED, *levels)), RANGE_DN, EXPECTED, 5.0) == []


def test_what_fills_the_picture_has_no_edge() -> None:
    large = np.array([[-50.0, -40], [460, -40], [460, 340], [-50, 340]])
    assert find_edges(_counts(_picture(large)), RANGE_DN, large, 5.0) == []


def test_a_frayed_edge_has_no_place() -> None:
    picture = _picture(EXPECTED)
    random = np.random.default_rng(2)
    for column in range(100, 300):  # fibres of up to 30 pixels beyond the upper edge
        picture[65 - random.integers(0, 30) : 75, column] = 2500
    found = find_edges(_counts(picture), RANGE_DN, EXPECTED, 5.0)
    assert 0 not in [edge.index for edge in found]
