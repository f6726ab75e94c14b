"""Spread of a map: scatter by u alone is uniform, more is not; one cell in 1000 is rejected."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.sample_maps.spread import rejected, spread_of


@pytest.mark.parametrize("seed", range(5))
def test_what_scatters_by_its_u_is_uniform_and_more_is_told(seed: int) -> None:
    random = np.random.default_rng(seed)
    u = random.uniform(0.5, 2.0, 4000)
    even = 20.0 + u * random.standard_normal(u.size)
    found = spread_of(even, u)
    assert found is not None
    assert found.uniform
    assert found.beyond == 0
    assert found.scatter == pytest.approx(found.explained, rel=0.1)
    true = random.uniform(1.0, 4.0)
    uneven = spread_of(even + true * random.standard_normal(u.size), u)
    assert uneven is not None
    assert not uneven.uniform
    assert uneven.beyond == pytest.approx(true, rel=0.15)


def test_cells_without_a_value_do_not_count() -> None:
    values = np.array([1.0, 2.0, np.nan, 3.0])
    found = spread_of(values, np.array([0.1, 0.1, 0.1, np.nan]))
    assert found is not None
    assert found.cells == 2
    assert spread_of(values, np.full(4, np.nan)) is None


@pytest.mark.parametrize("dof", [5, 30, 96])
def test_one_of_a_thousand_good_cells_is_rejected(dof: int) -> None:
    random = np.random.default_rng(dof)
    chi2 = random.chisquare(dof, 200_000)
    freedom = np.full(chi2.size, dof)
    assert rejected(chi2, freedom).mean() == pytest.approx(1e-3, abs=3e-4)
    assert rejected(np.full(3, 240.0), np.array([96, 96, 0])).tolist() == [True, True, False]
    assert not rejected(np.array([np.nan]), np.array([9])).any()
