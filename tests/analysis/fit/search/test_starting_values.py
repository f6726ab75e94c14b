"""Starting values: the scales solved for, the local minima of the grid, and their bounds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear, nnls

from analysis.fit.search.starting_values import (
    _different,
    bounded_least_squares,
    starting_values,
)
from analysis.models import MODELS
from instrument.geometry import FloatArray
from tests.support.analysis.seeded_scan import noise_free, problem_of

UNBOUNDED = 1e12


def stack(seed: int, columns: int, alike: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """Terms (20, 12, columns) that differ by the fraction `alike`, and data (20, 12)."""
    rng = np.random.default_rng(seed)
    A = alike * rng.normal(size=(20, 12, columns)) + (1 - alike) * rng.normal(size=(20, 12, 1))
    return A * 10.0 ** rng.uniform(-3, 3, size=columns), rng.normal(size=(20, 12))


@settings(derandomize=True, max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), columns=st.integers(1, 3))
def test_scales_agree_with_nnls(seed: int, columns: int) -> None:
    A, b = stack(seed, columns)
    found, left = bounded_least_squares(A, b, np.full(columns, UNBOUNDED))
    for n in range(len(b)):
        x, norm = nnls(A[n], b[n])
        np.testing.assert_allclose(found[n], x, rtol=1e-6, atol=1e-9 * np.max(x, initial=0))
        assert left[n] == pytest.approx(norm**2, rel=1e-9)


@pytest.mark.parametrize("columns", [2, 3])
@pytest.mark.parametrize("alike", [1e-3, 1e-6, 0.0])
def test_nearly_equal_terms_explain_as_much_as_one(columns: int, alike: float) -> None:
    """To the precision of the normal equations: a difference of 1e-6 is 1e-12 of them."""
    for seed in range(5):
        A, b = stack(seed, columns, alike)
        found, left = bounded_least_squares(A, b, np.full(columns, UNBOUNDED))
        assert np.all(found >= 0)
        for n in range(len(b)):
            _, norm = nnls(A[n], b[n])
            achieved = float(np.sum(np.square(A[n] @ found[n] - b[n])))
            assert left[n] == pytest.approx(achieved, rel=1e-3)
            assert norm**2 - 1e-9 <= achieved <= float(b[n] @ b[n]) + 1e-9
            if alike != 1e-6:  # where rounding hides the difference, any division will do
                assert achieved == pytest.approx(norm**2, rel=1e-6)


def test_a_single_scale_is_clipped_at_its_bound() -> None:
    A, b = stack(3, 1)
    high = np.array([0.1 / np.abs(A).mean()])
    found, left = bounded_least_squares(A, b, high)
    assert np.any(found == high)
    for n in range(len(b)):
        reference = lsq_linear(A[n], b[n], (0, high), tol=1e-14)
        assert left[n] == pytest.approx(2 * reference.cost, rel=1e-9)


def test_several_scales_stay_within_bounds_and_the_remainder_is_theirs() -> None:
    for seed in range(20):
        A, b = stack(seed, 3)
        high = 0.3 / np.abs(A).mean(axis=(0, 1))
        found, left = bounded_least_squares(A, b, high)
        assert np.all((found >= 0) & (found <= high * (1 + 1e-12)))
        achieved = np.sum(np.square(np.einsum("mni,mi->mn", A, found) - b), axis=1)
        assert left == pytest.approx(achieved, rel=1e-9)
        best = [2 * lsq_linear(a, y, (0, high)).cost for a, y in zip(A, b, strict=True)]
        assert np.all(left >= np.array(best) * (1 - 1e-6))
        assert np.mean(left / best) < 1.05  # good enough to begin with


def test_terms_of_zeros_get_scale_zero() -> None:
    found, left = bounded_least_squares(np.zeros((2, 5, 2)), np.ones((2, 5)), np.ones(2))
    assert found.tolist() == [[0, 0], [0, 0]]
    assert left.tolist() == [5, 5]


@pytest.mark.parametrize(
    "name", ["oren_nayar_qualitative", "oren_nayar_qualitative+torrance_sparrow_lobe", "unified"]
)
def test_a_truth_on_the_grid_is_the_first_starting_value(name: str) -> None:
    """For sums of terms that are proportional to their scales."""
    parameters = MODELS[name].parameters
    truth = {p.name: 0.3 if p.scale else p.starts[3] for p in parameters}
    first, *others = starting_values(problem_of(name, noise_free(name, truth)), 3)
    assert dict(zip(truth, first, strict=True)) == pytest.approx(truth, rel=1e-6)
    assert len(others) <= 2


@pytest.mark.parametrize("name", ["lambert", "wolff", "eon+ggx", "unified"])
@pytest.mark.parametrize("most", [1, 2, 5])
def test_starting_values_lie_within_the_domain_and_off_zero(name: str, most: int) -> None:
    m = noise_free("oren_nayar", {"albedo": 0.8, "sigma_deg": 35.0})
    problem = problem_of(name, m)
    found = starting_values(problem, most)
    assert 1 <= len(found) <= most
    for x in found:
        assert np.all((problem.low <= x) & (x <= problem.high))
        assert all(value > 0 for value in x)


def test_a_curve_that_fits_exactly_is_told_from_one_that_is_far_away() -> None:
    """Their distance in relation to a chi2 of zero is no number."""
    curves = np.array([[0.0, 0.0], [1e17, 0.0], [0.0, 0.0]])
    assert _different(curves, np.zeros(3), 3).tolist() == [0, 1]
