"""Best weights on candidates, and what the known designs for the papers' samples reach."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.data.measurements import Measurements
from analysis.design.bound import best_weights
from analysis.design.information import Information, assumed_problem
from analysis.models import MODELS
from instrument.geometry import FloatArray
from tests.support.analysis.designs import grid, information, planned, random_candidates

# Variance by the paper's 123 points over that by the best weights of as many photons: albedo,
# sigma_deg and ks of samples D, E and F of Oren and Nayar (1995) as in configs/protocols, and the
# ratios for sigma and ks that were computed by another program when these designs were proposed.
SAMPLES = {
    "D": ((0.80, 20.0, 0.076), 6.8, 8.8),
    "E": ((0.75, 42.0, 0.34), 4.0, 5.8),
    "F": ((0.70, 26.0, 0.172), 3.5, 4.9),
}


def _points(theta_i_deg: FloatArray, theta_r_deg: FloatArray) -> Measurements:
    return planned(*grid(theta_i_deg, theta_r_deg))


ROUNDS = 20_000
PAPER = _points(np.array([30.0, 45.0, 60.0]), np.linspace(-80.0, 80.0, 41))
LIST = _points(np.arange(0.0, 76.0, 5.0), np.arange(-80.0, 81.0, 5.0))


@pytest.mark.parametrize("sample", SAMPLES)
def test_the_best_spread_of_the_papers_photons_gains_what_is_known(sample: str) -> None:
    values, sigma_gain, ks_gain = SAMPLES[sample]
    x = np.array(values)
    before = information(PAPER, x).u(np.ones(123))
    found = information(LIST, x)
    best = best_weights(
        found, np.square(found.domain / x), 123, ROUNDS
    )  # relative variances, summed
    after = found.u(123 * best.weights)
    assert np.count_nonzero(best.weights > 0.02) <= 8
    assert (before["sigma_deg"] / after["sigma_deg"]) ** 2 == pytest.approx(sigma_gain, rel=0.1)
    assert (before["ks"] / after["ks"]) ** 2 == pytest.approx(ks_gain, rel=0.1)


def test_the_best_spread_for_plaster_gains_what_is_known() -> None:
    x = np.array([0.90, 30.0, 0.0])  # sample A, without gloss: the variances in units of domains
    before = information(PAPER, x).u(np.ones(123))
    found = information(LIST, x)
    best = best_weights(found, np.ones(3), 123, ROUNDS)
    after = found.u(123 * best.weights)
    assert (before["sigma_deg"] / after["sigma_deg"]) ** 2 == pytest.approx(10.6, rel=0.1)


@pytest.mark.parametrize("seed", range(4))
def test_no_candidate_is_more_sensitive_than_the_best_weights_allow(seed: int) -> None:
    """Equivalence theorem: weights are the best where no candidate exceeds their mean."""
    found = random_candidates(np.random.default_rng(seed), 25).information
    asked = found.weights(["sigma_deg", "albedo"])
    best = best_weights(found, asked, 20, ROUNDS)
    inverse = np.linalg.inv(found.matrix(20 * best.weights))
    sensitivity = np.square(found.rows @ inverse * np.sqrt(asked)).sum(axis=1)
    mean = float(best.weights @ sensitivity)
    assert sensitivity.max() * 20 <= mean * 20 + 2e-3 * best.criterion
    carried = best.weights > 0.05
    assert sensitivity[carried] == pytest.approx(np.full(carried.sum(), mean), rel=0.05)


@pytest.mark.parametrize("seed", range(4))
def test_no_random_weights_are_below_the_bound(seed: int) -> None:
    rng = np.random.default_rng(seed)
    found = random_candidates(rng, 12).information
    asked = found.weights(["sigma_deg"])
    best = best_weights(found, asked, 10, ROUNDS)
    assert best.bound <= best.criterion <= best.bound * 1.002
    for _ in range(50):
        counts = 10 * rng.dirichlet(np.full(12, 0.3))
        variance = np.diag(np.linalg.inv(found.matrix(counts)))
        assert float(asked @ variance) >= best.bound


def test_two_views_of_a_straight_line_share_the_weight() -> None:
    """A known design: the slope of a line is best told by its two ends, half of the points each."""
    line = np.linspace(-1.0, 1.0, 5)
    rows = np.stack([np.ones(5), line], axis=1) * 100
    known = Information(names=("level", "slope"), domain=np.ones(2), rows=rows)
    best = best_weights(known, np.array([0.0, 1.0]), 10, ROUNDS)
    assert best.weights == pytest.approx([0.5, 0, 0, 0, 0.5], abs=0.02)


def test_the_single_model_of_one_level_has_its_bound() -> None:
    m = planned(np.full(3, 30.0), np.array([-40.0, 0.0, 50.0]), u=0.01)
    found = Information.of(*assumed_problem(MODELS["lambert"], np.array([0.5]), m))
    best = best_weights(found, found.weights(["albedo"]), 3, ROUNDS)
    assert best.criterion == pytest.approx(1.0, rel=1e-3)
