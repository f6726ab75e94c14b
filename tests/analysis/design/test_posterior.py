"""Uncertainty that a design leaves, point by point: as computed anew."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.design.posterior import Posterior
from tests.support.analysis.designs import random_candidates


@pytest.mark.parametrize("seed", range(4))
def test_points_added_and_removed_leave_what_a_new_computation_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    known = random_candidates(rng, 20).information
    weights = known.weights(["albedo", "ks"])
    chosen = np.zeros(20, dtype=bool)
    chosen[:6] = True
    now = Posterior(known, weights, chosen)
    for point in rng.permutation(20)[:12]:
        expected = chosen.copy()
        expected[point] = not chosen[point]
        if chosen[point]:
            without = float(now.without(int(point)).sum())
            now.remove(int(point))
            assert without == pytest.approx(now.criterion, rel=1e-6)
        else:
            added = float(now.with_one_more()[point])
            now.add(int(point))
            assert added == pytest.approx(now.criterion, rel=1e-6)
        chosen = expected
        new = Posterior(known, weights, chosen)
        assert now.criterion == pytest.approx(new.criterion, rel=1e-5)
        assert now.cross == pytest.approx(new.cross, rel=1e-4, abs=1e-5)
