"""Least-squares problems: a search does not end at a bound with zero derivative."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.analysis.seeded_scan import noise_free, problem_of


@pytest.mark.parametrize("name", ["oren_nayar_qualitative", "oren_nayar", "oren_nayar_exact"])
def test_the_search_leaves_zero_roughness(name: str) -> None:
    """A surface depends on the square of its roughness: at 0 the derivative is 0."""
    truth = {"albedo": 0.7, "sigma_deg": 30.0}
    problem = problem_of(name, noise_free(name, truth))
    found = problem.solve(np.array([0.6, 0.0]))
    assert found.converged
    assert found.x == pytest.approx(list(truth.values()), rel=1e-6)
    smooth = problem_of(name, noise_free("lambert", {"albedo": 0.7}))
    assert smooth.solve(np.array([0.6, 0.0])).x == pytest.approx([0.7, 0.0], abs=1e-4)
    assert problem.solve(np.array([0.6, 0.0]), held=[1]).x[1] == 0
