"""Choice of geometries: against all subsets, whatever the order of the candidates."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest

from analysis.design.information import Information
from analysis.design.optimal import LACK_OF_FIT, Candidates, choose
from instrument.geometry import Geometry
from tests.support.analysis.designs import random_candidates

ASKED = ["sigma_deg", "albedo"]


def _objective(candidates: Candidates, chosen: list[int], asked: list[str]) -> float:
    """Weighted variances times time."""
    mask = np.zeros(len(candidates.information.rows), dtype=bool)
    mask[chosen] = True
    variance = np.diag(np.linalg.inv(candidates.information.matrix(mask.astype(float))))
    criterion = float(candidates.information.weights(asked) @ variance)
    return criterion * candidates.costs.total_s(mask)


@pytest.mark.parametrize("seed", range(12))
def test_the_choice_is_the_best_of_all_subsets(seed: int) -> None:
    rng = np.random.default_rng(seed)
    candidates = random_candidates(rng, 11, equal_costs=seed % 3 == 0)
    count = int(rng.integers(3, 6))
    found = [pick.candidate for pick in choose(candidates, ASKED, count, share=0.0)]
    every = combinations(range(11), count)
    best = min(_objective(candidates, list(subset), ASKED) for subset in every)
    assert _objective(candidates, found, ASKED) == pytest.approx(best, rel=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_the_choice_does_not_depend_on_the_order_of_the_candidates(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    candidates = random_candidates(rng, 40)
    order = rng.permutation(40)
    g, known = candidates.geometry, candidates.information
    other = Candidates(
        geometry=Geometry(g.theta_i_deg[order], g.theta_r_deg[order], g.dphi_deg[order]),
        information=replace(known, rows=known.rows[order]),
        costs=candidates.costs.ordered(order),
    )
    first = {(p.candidate, p.reason) for p in choose(candidates, ASKED, 12, seed=seed)}
    second = {(int(order[p.candidate]), p.reason) for p in choose(other, ASKED, 12, seed=seed)}
    assert first == second


@pytest.mark.parametrize("seed", range(3))
def test_more_points_give_no_larger_u_where_all_cost_the_same(seed: int) -> None:
    candidates = random_candidates(np.random.default_rng(200 + seed), 30, equal_costs=True)
    u = []
    for count in range(3, 16, 2):
        chosen = np.zeros(30)
        picks = choose(candidates, ["sigma_deg"], count, share=0.0)
        chosen[[pick.candidate for pick in picks]] = 1
        u.append(candidates.information.u(chosen)["sigma_deg"])
    assert all(after <= before * (1 + 1e-9) for before, after in pairwise(u))


@pytest.mark.parametrize("count", [1, 2, 5, 6, 11, 20])
def test_a_fifth_of_the_points_or_more_is_spread_for_lack_of_fit(count: int) -> None:
    candidates = random_candidates(np.random.default_rng(7), 50)
    picks = choose(candidates, ASKED, count)
    assert len({pick.candidate for pick in picks}) == count
    assert sum(pick.reason == LACK_OF_FIT for pick in picks) >= count / 5
    assert {pick.reason for pick in picks} <= {*ASKED, LACK_OF_FIT}


def test_a_dear_lamp_setting_is_left_out_where_it_teaches_too_little() -> None:
    candidates = random_candidates(np.random.default_rng(3), 30, equal_costs=True)
    dear = replace(candidates.costs, setting_s=np.array([0.0, 0.0, 1e6]))
    picks = choose(replace(candidates, costs=dear), ASKED, 8, share=0.0)
    assert not [p for p in picks if candidates.costs.setting[p.candidate] == 2]


def test_the_same_seed_gives_the_same_choice() -> None:
    candidates = random_candidates(np.random.default_rng(5), 40)
    assert choose(candidates, ASKED, 9, seed=4) == choose(candidates, ASKED, 9, seed=4)


@pytest.mark.parametrize(
    ("asked", "count", "words"),
    [
        (["sigma_deg"], 31, "31 geometries; allowed: 1 to 30"),
        (["sigma_deg"], 0, "0 geometries; allowed: 1 to 30"),
        (["gloss"], 3, "gloss is no parameter of the model; allowed: albedo, sigma_deg, ks"),
        ([], 3, "no parameter is asked for; allowed: some of albedo, sigma_deg, ks"),
    ],
)
def test_what_cannot_be_chosen_is_refused(asked: list[str], count: int, words: str) -> None:
    candidates = random_candidates(np.random.default_rng(5), 30)
    with pytest.raises(ValueError, match=words):
        choose(candidates, asked, count)


def test_each_point_is_for_the_parameter_that_would_lose_most_without_it() -> None:
    rows = np.array([[50.0, 0.0], [40.0, 0.0], [0.0, 30.0], [0.0, 20.0], [1.0, 1.0]])
    known = Information(names=("a", "b"), domain=np.ones(2), rows=rows)
    angles = np.arange(5.0)
    some = random_candidates(np.random.default_rng(1), 5, equal_costs=True)
    candidates = replace(
        some,
        geometry=Geometry.from_degrees(theta_i=10.0, theta_r=angles),
        information=known,
        costs=replace(some.costs, setting=np.zeros(5, dtype=np.int64)),
    )
    picks = choose(candidates, ["a", "b"], 4, share=0.0)
    assert [(p.candidate, p.reason) for p in picks] == [(0, "a"), (1, "a"), (2, "b"), (3, "b")]
