"""Agreement of runs: chi² as of the whole covariance, shared errors shared, false alarms rare."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.comparison.agreement import Agreement, Values, agreement
from analysis.data.covariance import Covariance
from instrument.geometry import FloatArray

OWN, TILE = "dark", "white tile certificate"


def drawn(
    rng: np.random.Generator, runs: int, geometries: int, factor: float = 1.0, bump: float = 0.0
) -> list[Values]:
    """Runs of one sample, each with noise, an error of its own and the tile's error in common.

    factor: of the level of all runs but the first. bump: what they have more at one geometry.
    """
    true = rng.uniform(0.05, 0.3, geometries)
    tile = rng.normal()
    found = []
    for k in range(runs):
        u = rng.uniform(0.002, 0.02, geometries) * true
        common = np.stack([0.01 * true, 0.03 * true], axis=-1)
        errors = np.array([rng.normal(), tile])
        changed = true * (factor if k else 1.0)
        changed[0] += bump if k else 0.0
        brdf = changed + u * rng.normal(size=geometries) + common @ errors
        found.append(
            Values(brdf=brdf, covariance=Covariance(u**2, common, (OWN, TILE)), model=true)
        )
    return found


def compared(seed: int, runs: int, geometries: int, **changed: float) -> Agreement:
    return agreement(drawn(np.random.default_rng(seed), runs, geometries, **changed), (TILE,))


def by_whole_covariance(runs: list[Values]) -> float:
    """chi² of K runs by the dense covariance of all values, and a mean for each geometry."""
    count, size = len(runs), runs[0].brdf.size
    C = np.zeros((count * size, count * size))
    for k, run in enumerate(runs):
        own = slice(k * size, (k + 1) * size)
        C[own, own] += np.diag(run.covariance.variance)
        for m, other in enumerate(runs):
            there = slice(m * size, (m + 1) * size)
            column = np.asarray(run.covariance.common), np.asarray(other.covariance.common)
            C[own, there] += np.outer(column[0][:, 1], column[1][:, 1])
            if k == m:
                C[own, own] += np.outer(column[0][:, 0], column[0][:, 0])
    y, X = np.concatenate([r.brdf for r in runs]), np.tile(np.eye(size), (count, 1))
    inverse = np.linalg.inv(C)
    mean = np.linalg.solve(X.T @ inverse @ X, X.T @ inverse @ y)
    rest: FloatArray = y - X @ mean
    return float(rest @ inverse @ rest)


@pytest.mark.parametrize(("runs", "geometries"), [(2, 1), (2, 12), (3, 7), (5, 4)])
def test_chi2_is_that_of_the_whole_covariance(runs: int, geometries: int) -> None:
    values = drawn(np.random.default_rng(1000 * runs + geometries), runs, geometries)
    found = agreement(values, (TILE,))
    assert found.whole.chi2 == pytest.approx(by_whole_covariance(values), rel=1e-6)
    assert found.whole.dof == (runs - 1) * geometries


def test_runs_of_one_sample_agree_as_often_as_stated() -> None:
    found = [compared(seed, 2 + seed % 3, 3 + seed % 20) for seed in range(600)]
    chi2, dof = (sum(getattr(f.whole, name) for f in found) for name in ("chi2", "dof"))
    assert chi2 / dof == pytest.approx(1.0, abs=4 * np.sqrt(2 / dof))
    refused = sum(not f.whole.agrees for f in found)
    assert refused <= 6 + 4 * np.sqrt(6)  # 1 % of 600, at four standard deviations
    pulls = np.concatenate([(f.factors[1:] - 1) / f.u_factors[1:] for f in found])
    assert np.std(pulls) == pytest.approx(1.0, abs=4 / np.sqrt(2 * pulls.size))


@pytest.mark.parametrize("runs", [2, 3])
def test_a_brighter_run_differs_in_its_level_and_not_in_its_shape(runs: int) -> None:
    found = compared(7, runs, 15, factor=1.10)
    assert not found.whole.agrees
    assert found.shape.agrees
    assert np.all(np.abs(found.factors[1:] - 1.10) < 4 * found.u_factors[1:])
    assert np.all(found.u_factors[1:] < 0.03)  # the tile's 3 % is the same in all


def test_a_difference_at_one_geometry_is_one_of_shape() -> None:
    found = compared(8, 2, 15, bump=0.05)
    assert not found.whole.agrees
    assert not found.shape.agrees
    assert np.argmax(np.abs(found.difference[1] / found.u_difference[1])) == 0


def test_an_error_that_both_share_cannot_make_them_disagree() -> None:
    values = drawn(np.random.default_rng(9), 2, 10)
    moved = [
        Values(brdf=v.brdf + 0.3 * v.model, covariance=v.covariance, model=v.model) for v in values
    ]
    assert agreement(moved, (TILE,)).whole.chi2 == pytest.approx(
        agreement(values, (TILE,)).whole.chi2, rel=1e-6
    )
    one_only = [values[0], moved[1]]
    assert not agreement(one_only, (TILE,)).whole.agrees


def test_a_tile_of_its_own_for_each_run_leaves_more_room() -> None:
    values = drawn(np.random.default_rng(10), 2, 10, factor=1.06)
    assert not agreement(values, (TILE,)).whole.agrees
    assert agreement(values).whole.agrees  # 3 % in each tile
