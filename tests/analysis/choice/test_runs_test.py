"""Runs test of residuals: runs of one sign, and the stretches where a model fits worst."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.choice.runs_test import Stretch, runs_probability, worst_stretches
from analysis.data.measurements import Measurements
from analysis.data.sweeps import sweeps
from instrument.geometry import FloatArray, Geometry
from tests.support.analysis.seeded_scan import three_sweeps


def test_a_single_point_is_not_a_sweep() -> None:
    m = Measurements.bare([10.0, 20.0, 20.0, 20.0], [5.0, 5.0, 15.0, 5.0], [0, 0, 0, 90.0], 0.2)
    assert [s.points.tolist() for s in sweeps(m)] == [[1, 2]]
    assert runs_probability(m, np.array([1.0, 1, 1, 1])) == 1


@pytest.mark.parametrize("incidences", [1, 3])
def test_noise_is_rarely_taken_for_structure(incidences: int) -> None:
    """A probability below p occurs in about that fraction of scans: 0.05 of 300 is 15 +- 3.8."""
    m = three_sweeps()
    m = Measurements.bare(m.theta_i_deg[: 32 * incidences], m.theta_r_deg[: 32 * incidences], 0, 1)
    rng = np.random.default_rng(7)
    found = np.array([runs_probability(m, rng.normal(size=m.size)) for _ in range(300)])
    for p in (0.05, 0.25, 0.5):
        assert np.mean(found < p) <= p + 3 * np.sqrt(p * (1 - p) / 300)
    assert np.mean(found < 0.05) <= 0.08
    assert np.mean(found < 0.5) >= 0.3  # runs are whole numbers, so the test is conservative
    assert np.all(found >= 1e-4)


def test_a_smooth_misfit_is_improbable_and_an_alternating_one_is_not() -> None:
    m = three_sweeps()
    noise = np.random.default_rng(2).normal(size=m.size)
    waves = np.sin(np.radians(4 * m.theta_r_deg))
    assert runs_probability(m, waves) < 1e-12
    assert runs_probability(m, 2 * waves + noise) < 1e-3
    assert runs_probability(m, (-1.0) ** np.arange(m.size)) > 0.999
    assert runs_probability(m, np.zeros(m.size)) == 1
    assert runs_probability(m, np.ones(m.size)) == 1  # an offset is left to chi2


def test_runs_follow_the_angle_and_not_the_order_of_measurement() -> None:
    order = np.random.default_rng(3).uniform(size=96)
    m, shuffled = three_sweeps(), three_sweeps(order)
    waves = np.sin(np.radians(4 * m.theta_r_deg))
    assert runs_probability(shuffled, waves[np.argsort(order)]) == runs_probability(m, waves)


def test_points_set_aside_do_not_count_in_runs() -> None:
    m = three_sweeps()
    waves = np.sin(np.radians(4 * m.theta_r_deg))
    waves[np.abs(waves) < 0.3] = 0
    assert runs_probability(m, waves) < 1e-9
    counted = waves != 0
    less = Measurements.bare(m.theta_i_deg[counted], m.theta_r_deg[counted], 0, 1.0)
    assert runs_probability(m, waves) == pytest.approx(runs_probability(less, waves[counted]))


def bump(m: Measurements, height: float) -> FloatArray:
    """Alternating residuals of half a u, and `height` u at theta_i 45, theta_r 10 to 30."""
    there = (m.theta_i_deg == 45) & (m.theta_r_deg >= 10) & (m.theta_r_deg <= 30)
    return np.where(there, height, 0.5 * (-1.0) ** np.arange(m.size))


@pytest.mark.parametrize("height", [4.0, -4.0])
def test_the_failing_stretch_is_named(height: float) -> None:
    m = three_sweeps()
    worst, *others = worst_stretches(m, bump(m, height))
    assert worst[:2] == (45, 0)
    # A neighbour of the same sign may belong to it.
    assert worst.from_deg in (5, 10)
    assert worst.to_deg in (30, 35)
    assert worst.mean == pytest.approx(height, rel=0.3)
    assert worst.weight == pytest.approx(abs(height) * np.sqrt(5), rel=0.2)
    assert others == []  # the rest is noise
    assert "theta_i 45, dphi 0 degrees: theta_r" in str(worst)
    assert ("(+" if height > 0 else "(-") in str(worst)


def test_a_stretch_over_the_normal_is_named_in_the_plane_of_the_sweep() -> None:
    """Tables without signs: 180 degrees of dphi on the mirror side, 0 on the lamp's."""
    views, signed = np.array([20.0, 10.0, 10.0, 20.0]), [-20.0, -10.0, 10.0, 20.0]
    dphi = np.where(np.array(signed) < 0, 180.0, 0.0)
    m = Measurements.bare(45.0, views, dphi, 0.2)
    for residuals, named in (
        ([5.0, 5.0, 5.0, -0.1], (0.0, -20.0, 10.0)),
        ([5.0, 5.0, -0.1, 0.1], (180.0, 10.0, 20.0)),
        ([0.1, -0.1, 5.0, 5.0], (0.0, 10.0, 20.0)),
    ):
        worst, *_ = worst_stretches(m, np.array(residuals))
        assert worst[1:4] == named


def test_the_worst_stretch_comes_first_and_noise_is_not_reported() -> None:
    m = three_sweeps()
    r = bump(m, 4.0)
    r[m.theta_i_deg == 60] -= 2.0
    assert [s.theta_i_deg for s in worst_stretches(m, r)] == [60, 45]
    assert len(worst_stretches(m, r, most=1)) == 1
    calm = worst_stretches(m, 0.5 * (-1.0) ** np.arange(m.size))
    assert len(calm) == 1  # the worst is always reported


def test_a_point_set_aside_does_not_split_a_stretch() -> None:
    """An outlier of a robust fit has residual 0 among neighbours of either sign."""
    m = three_sweeps()
    for height in (4.0, -4.0):
        r = bump(m, height)
        r[(m.theta_i_deg == 45) & (m.theta_r_deg == 20)] = 0
        (worst,) = worst_stretches(m, r)
        assert worst.from_deg <= 10
        assert worst.to_deg >= 30
        assert abs(worst.mean) > 2.5
    assert worst_stretches(m, np.zeros(m.size)) == []


@pytest.mark.parametrize(
    ("theta_r", "dphi", "named"),
    [
        (35.0, 40.0, (40, 35)),
        (-35.0, 40.0, (40, -35)),
        (35.0, 200.0, (200, 35)),
        (-35.0, 200.0, (200, -35)),
    ],
)
def test_scattered_points_are_reported_with_their_angles(
    theta_r: float, dphi: float, named: tuple[float, float]
) -> None:
    """As the table has them: theta_r signed or not, dphi below 180 degrees or not."""
    m = Measurements.bare([10.0, 20.0, 30.0], [15.0, theta_r, 25.0], [70.0, dphi, 110.0], 0.2)
    assert sweeps(m) == ()
    (worst,) = worst_stretches(m, np.array([0.1, -9.0, 0.1]))
    assert worst == Stretch(20, named[0], named[1], named[1], -9, 9)
    here = Geometry.from_degrees(theta_i=20, theta_r=worst.from_deg, dphi=worst.dphi_deg)
    there = m.geometry
    assert (here.theta_r_deg, here.dphi_deg) == (there.theta_r_deg[1], there.dphi_deg[1])
    where = f"theta_i 20, dphi {named[0]} degrees: theta_r {named[1]} degrees (-9 u)"
    assert str(worst) == where
