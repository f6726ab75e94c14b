"""Models that a design tells from the assumed one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.design.information import Information, assumed_problem
from analysis.design.optimal import RIVALS, Candidates, Costs, choose
from analysis.design.rivals import TOLD_APART, Rival, leading, telling_apart
from analysis.models import MODELS
from tests.support.analysis.designs import FOAM, GLOSSY, grid, planned

THETA_I, THETA_R = grid(np.array([30.0, 60.0]), np.linspace(-75.0, 75.0, 31))
M = planned(THETA_I, THETA_R, u=0.04)
PROBLEM, X = assumed_problem(GLOSSY, FOAM, M)


def _rival(name: str, start: list[float]) -> Rival:
    return Rival.fitted(replace(PROBLEM, model=MODELS[name]), np.array(start))


LAMBERT_GLOSS = _rival("lambert+torrance_sparrow", [0.8, 0.1, 20.0])
CANDIDATES = Candidates(
    geometry=M.geometry,
    information=Information.of(PROBLEM, X),
    costs=Costs(
        point_s=np.ones(THETA_I.size),
        setting=(THETA_I > 45).astype(np.int64),
        setting_s=np.zeros(2),
    ),
)


def _mask(chosen: list[int]) -> np.ndarray:
    mask = np.zeros(THETA_I.size, dtype=bool)
    mask[chosen] = True
    return mask


@pytest.mark.parametrize("seed", range(3))
def test_a_point_for_telling_apart_does_so_better_than_most_others(seed: int) -> None:
    rng = np.random.default_rng(seed)
    design = _mask(rng.choice(THETA_I.size, 10, replace=False).tolist())
    every = np.arange(THETA_I.size)
    picked = telling_apart((LAMBERT_GLOSS,), CANDIDATES.costs.one_more_s, design, 1, every)
    told = LAMBERT_GLOSS.missed(design | picked)
    others = [
        LAMBERT_GLOSS.missed(design | _mask([int(point)]))
        for point in rng.choice(np.flatnonzero(~design), 20, replace=False)
    ]
    assert LAMBERT_GLOSS.missed(design) <= told
    assert told >= np.quantile(others, 0.9)


def test_points_that_tell_a_rival_apart_raise_what_its_best_fit_misses() -> None:
    rivals = (LAMBERT_GLOSS,)
    with_rivals = choose(CANDIDATES, ["albedo"], 10, rivals=rivals)
    without = choose(CANDIDATES, ["albedo"], 10)
    extra = [pick for pick in with_rivals if pick.reason == RIVALS]
    assert 1 <= len(extra) <= 2
    told, untold = (
        LAMBERT_GLOSS.missed(_mask([p.candidate for p in picks]))
        for picks in (with_rivals, without)
    )
    assert told > 2 * untold


def test_a_rival_that_the_other_points_tell_apart_needs_none() -> None:
    sharper = replace(PROBLEM.covariance, variance=PROBLEM.covariance.variance / 1e6)
    rival = Rival.fitted(replace(LAMBERT_GLOSS.problem, covariance=sharper), LAMBERT_GLOSS.x)
    picks = choose(CANDIDATES, ["sigma_deg"], 15, rivals=(rival,))
    assert not [pick for pick in picks if pick.reason == RIVALS]
    assert rival.missed(_mask([p.candidate for p in picks])) > TOLD_APART


def test_the_leading_rivals_are_those_that_come_closest_and_no_larger_model() -> None:
    names = [
        "lambert",
        "lambert+torrance_sparrow",
        "oren_nayar_exact+torrance_sparrow",  # the same physics
        "oren_nayar+torrance_sparrow_lobe",  # of which the assumed model is a special case
        "oren_nayar",
    ]
    found = leading(PROBLEM, M, names)
    assert {rival.name for rival in found} == {"lambert", "lambert+torrance_sparrow", "oren_nayar"}
    assert [rival.chi2 for rival in found] == sorted(rival.chi2 for rival in found)
