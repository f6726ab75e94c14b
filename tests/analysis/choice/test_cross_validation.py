"""Cross-validation: blocks of points left out, and their prediction by the models."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.choice.choice import choose
from analysis.choice.cross_validation import MAX_FOLDS, folds, held_out_error
from analysis.data.measurements import Measurements
from analysis.data.sweeps import signed_view
from analysis.fit.first_fit import first_fit
from analysis.models import MODELS
from instrument.geometry import FloatArray, Geometry
from tests.support.analysis.seeded_scan import scan, scan_angles

VIEWS = np.linspace(-80, 80, 33)
GLOSS = {"albedo": 0.75, "sigma_deg": 25.0, "ks": 0.2}
ANGLES = st.tuples(st.integers(0, 8), st.integers(-8, 8), st.sampled_from([0, 40, 180, 270]))


def sweeps_of(*incidences: float) -> Measurements:
    theta_i = np.repeat(incidences, VIEWS.size)
    return Measurements.bare(theta_i, np.tile(VIEWS, len(incidences)), 0.0, 0.2, 1e-3)


@settings(derandomize=True, max_examples=100)
@given(points=st.lists(ANGLES, min_size=1, max_size=60))
def test_each_point_is_left_out_exactly_once_and_never_all(
    points: list[tuple[int, int, int]],
) -> None:
    theta_i, theta_r, dphi = np.array(points, dtype=np.float64).T
    left_out = folds(Measurements.bare(10 * theta_i, 10 * theta_r, dphi, 0.2))
    assert len(left_out) != 1
    assert len(left_out) <= MAX_FOLDS
    if left_out:
        assert np.sum(left_out, axis=0).tolist() == [1] * len(points)
        assert all(0 < np.sum(fold) < len(points) for fold in left_out)


@pytest.mark.parametrize("count", [3, 4, 5, 7, 12])
def test_an_incidence_is_left_out_as_a_whole(count: int) -> None:
    m = sweeps_of(*np.linspace(0, 75, count))
    left_out = folds(m)
    assert len(left_out) == min(count, MAX_FOLDS)
    for fold in left_out:
        for theta_i in np.unique(m.theta_i_deg):
            assert np.ptp(fold[m.theta_i_deg == theta_i].astype(int)) == 0
    sizes = [int(np.sum(fold)) for fold in left_out]
    assert max(sizes) <= 2 * min(sizes)


@pytest.mark.parametrize("incidences", [(45.0,), (30.0, 60.0)])
def test_with_one_or_two_incidences_blocks_of_view_angles_are_left_out(
    incidences: tuple[float],
) -> None:
    m = sweeps_of(*incidences)
    left_out = folds(m)
    assert len(left_out) == MAX_FOLDS
    reach = [(float(m.theta_r_deg[f].min()), float(m.theta_r_deg[f].max())) for f in left_out]
    assert reach[0][0] == -80
    assert reach[-1][1] == 80
    for (_, last), (first, _) in itertools.pairwise(reach):
        assert first - last == 5  # blocks of neighbours, one after the other


def test_both_forms_of_a_geometry_make_the_same_blocks() -> None:
    m = sweeps_of(45.0)
    turned = replace(
        m, theta_r_deg=np.abs(m.theta_r_deg), dphi_deg=np.where(m.theta_r_deg < 0, 180.0, 0.0)
    )
    for one, other in zip(folds(m), folds(turned), strict=True):
        assert one.tolist() == other.tolist()


def test_scattered_directions_are_left_out_in_blocks_of_incidence() -> None:
    rng = np.random.default_rng(0)
    m = Measurements.bare(
        rng.uniform(0, 80, 100), rng.uniform(0, 80, 100), rng.uniform(0, 360, 100), 0.2
    )
    left_out = folds(m)
    assert [int(np.sum(fold)) for fold in left_out] == [20] * 5
    reach = [(m.theta_i_deg[f].min(), m.theta_i_deg[f].max()) for f in left_out]
    assert all(a[1] < b[0] for a, b in itertools.pairwise(reach))


@pytest.mark.parametrize("aside", [(0.0, 10.0), (60.0, 75.0), (0.0, 75.0)])
def test_a_sweep_with_a_few_other_points_is_not_left_out_as_a_whole(
    aside: tuple[float, float],
) -> None:
    """Two points do not predict ninety-seven, whatever the model."""
    theta_i = np.r_[aside, np.full(97, 45.0)]
    theta_r = np.r_[5.0, 5.0, np.linspace(-80, 80, 97)]
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r)
    value = MODELS["oren_nayar+torrance_sparrow"].brdf(geometry, **GLOSS)
    noise = 1 + 2e-3 * np.random.default_rng(3).normal(size=99)
    m = Measurements.bare(theta_i, theta_r, 0.0, value * noise, 2e-3 * value)
    left_out = folds(m)
    assert len(left_out) == MAX_FOLDS
    assert max(np.sum(fold) for fold in left_out) < 30
    assert np.all(np.diff([np.mean(signed_view(m)[fold]) for fold in left_out]) > 0)
    found = choose(m, models=["oren_nayar_qualitative", "oren_nayar+torrance_sparrow"])
    assert (found.chosen, found.verdict) == ("oren_nayar+torrance_sparrow", "adequate")


def test_one_view_angle_leaves_nothing_out() -> None:
    assert folds(Measurements.bare(30.0, [10.0] * 4, 0.0, 0.2)) == []
    assert folds(Measurements.bare([30.0, 60.0], 10.0, 0.0, 0.2)) == []


def prediction_error(name: str, m: Measurements) -> float:
    """Prediction error of a model at the points left out of its fits."""
    fitted = first_fit(MODELS[name], m)
    return held_out_error(m, fitted.problem, fitted.solution.x, folds(m))


def score(
    true: str, other: str, truth: dict[str, float], count: int, *, one: bool = False
) -> FloatArray:
    """Prediction error of `other` minus that of the true model, (count,) for as many seeds."""
    found = []
    for seed in range(count):
        m = scan(true, seed, u_tile=0.0, u_deg=0.0, **truth)
        if one:
            k = m.theta_i_deg == 45
            m = Measurements.bare(45.0, m.theta_r_deg[k], 0.0, m.brdf[k], 5e-4 * m.brdf[k])
        found.append(prediction_error(other, m) - prediction_error(true, m))
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("true", "other", "truth", "by_one"),
    [
        ("lambert", "oren_nayar_qualitative", {"albedo": 0.8}, False),
        ("lambert", "lambert+torrance_sparrow", {"albedo": 0.8}, False),
        (
            "oren_nayar_qualitative",
            "oren_nayar_qualitative+torrance_sparrow",
            {"albedo": 0.8, "sigma_deg": 25.0},
            True,
        ),
    ],
)
def test_an_unnecessary_term_predicts_worse(
    true: str, other: str, truth: dict[str, float], by_one: bool, slow: bool
) -> None:
    """On average: in half of all scans the term is fitted as 0, and both models agree.

    At three incidences and at one with `pytest --slow`; else `by_one`: at one only.
    """
    for one in (False, True) if slow else (by_one,):
        worse = score(true, other, truth, 20, one=one)
        assert np.mean(worse) > 0
        assert np.mean(worse > -0.5) > 0.7


@pytest.mark.parametrize(
    ("true", "other", "truth"),
    [
        ("oren_nayar_qualitative", "lambert", {"albedo": 0.8, "sigma_deg": 25.0}),
        ("oren_nayar", "oren_nayar_qualitative", {"albedo": 0.8, "sigma_deg": 30.0}),
        ("lambert+torrance_sparrow", "lambert", {"albedo": 0.7, "sigma_deg": 10.0, "ks": 0.05}),
    ],
)
def test_a_necessary_term_predicts_better(true: str, other: str, truth: dict[str, float]) -> None:
    assert np.all(score(true, other, truth, 5) > 100)


def test_a_true_model_predicts_about_as_well_as_it_fits() -> None:
    """A mean of 64 points predicts each of the other 32 with u^2 = 1 + 1 / 64; the mean absolute
    value of a normal error is sqrt(2 / pi) of that.
    """
    found = []
    for seed in range(60):
        m = scan("lambert", seed, u_tile=0.0, u_deg=0.0, albedo=0.8)
        found.append(prediction_error("lambert", m))
    expected = 96 * np.sqrt(2 / np.pi * (1 + 1 / 64))
    # The absolute value of a normal error has the standard deviation sqrt(1 - 2 / pi).
    assert np.mean(found) == pytest.approx(expected, abs=3 * np.sqrt((1 - 2 / np.pi) * 96 / 60))


def test_one_outlier_counts_once() -> None:
    """An error of 100 u at one point changes the prediction of the others by at most 100 / 64."""
    theta_i, theta_r, dphi = scan_angles()
    value = np.full(theta_i.size, 0.2)
    value[40] += 0.1
    m = Measurements.bare(theta_i, theta_r, dphi, value, 1e-3)
    found = first_fit(MODELS["lambert"], m)
    assert 100 < held_out_error(m, found.problem, found.solution.x, folds(m)) < 100 + 96 * 100 / 64
