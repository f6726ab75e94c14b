"""Readings off curves: peaks, widths, bends, of curves whose answers are known."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.gallery.curves import (
    around,
    half_width,
    kink_at,
    peak_at,
    rises,
    spread,
    straightness,
    towards_mirror,
)

RNG = np.random.default_rng(23)


@pytest.mark.parametrize(("centre", "sigma"), RNG.uniform((-30, 1), (30, 9), (20, 2)).tolist())
def test_a_gaussian_has_its_peak_and_its_width(centre: float, sigma: float) -> None:
    x = np.linspace(-90, 90, 3001)
    y = np.exp(-0.5 * ((x - centre) / sigma) ** 2)
    assert peak_at(x, y) == pytest.approx(centre, abs=1e-3)
    assert half_width(x, y) == pytest.approx(2.35482 * sigma, rel=2e-3)


@pytest.mark.parametrize("bend", RNG.uniform(-40, 40, 10).round(0).tolist())
def test_a_bend_is_found(bend: float) -> None:
    x = np.arange(-60.0, 61.0)
    assert kink_at(x, np.minimum(x, bend) + 1e-3 * x**2) == bend


def test_lines_are_straight_and_others_are_not() -> None:
    x = RNG.uniform(-1, 1, 50)
    assert straightness(x, 3 * x - 2) == pytest.approx(1)
    assert straightness(x, x * x) < 0.9


def test_rising_and_spread() -> None:
    assert rises(np.array([1.0, 1.0, 2.0]))
    assert not rises(np.array([1.0, 0.9]))
    assert spread(np.array([1.0, 3.0])) == 1.0


def test_angles_around_a_peak_hold_it_and_stay_within_the_ends() -> None:
    x = around(60.0, 0.01, 80.0)
    assert 60.0 in x
    assert np.all(np.diff(x) > 0)
    assert x[0] == -80.0
    assert x[-1] == 80.0
    assert np.sum(np.abs(x - 60.0) < 0.05) > 50


def test_the_mirror_side_of_1991_is_dphi_180() -> None:
    at = towards_mirror(30.0, np.array([40.0, -40.0]))
    np.testing.assert_allclose(at.dphi_deg, [180.0, 0.0])
    np.testing.assert_allclose(at.theta_r_deg, 40.0)
