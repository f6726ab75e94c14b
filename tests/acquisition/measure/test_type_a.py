"""Scatter beside predicted noise: noise alone is not seen, more is, with its size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, norm

from acquisition.measure.drift import Drift
from acquisition.measure.type_a import chi_squared_limit, noise_ratio, scatter_ratio
from instrument.geometry import FloatArray
from instrument.record.reading import Reading
from tests.support.scans import small_scan

CAMERA = small_scan().rig.camera
U = 2e-4


def check(time_s: float, level: float) -> Reading:
    """A drift check of 1000 frames' worth of pixels, with a noise of U."""
    return Reading(
        step=int(time_s), kind="drift", surface="sample", theta_i_deg=30.0, dphi_deg=0.0,
        theta_r_deg=0.0, lamp_setting=0, block=0, signal_dn=2000.0 * level,
        u_noise_dn=2000.0 * U, u_quantisation_dn=0.0, u_dark_dn=0.0, u_placement_dn=0.0,
        u_texture_dn=0.0, exposure_s=0.01, frames=4, window_pixels=1000.0, saturated_pixels=0,
        peak_dn=2500.0, time_s=time_s, free_s=time_s, time_utc="", flags="",
    )  # fmt: skip


def levels(seed: int, times_noise: float, count: int = 9) -> tuple[FloatArray, FloatArray]:
    """Times and levels of checks of a lamp that drifts steadily, by 1 % in all."""
    times = np.linspace(0.0, 600.0, count)
    noise = times_noise * U * np.random.default_rng(seed).standard_normal(count)
    return times, 1 + 0.01 * times / 600 + noise


@pytest.mark.parametrize("freedom", [2, 3, 8, 30])
def test_the_limit_of_chi_squared_is_that_of_the_distribution(freedom: int) -> None:
    exact = chi2.isf(norm.sf(4.0), freedom)
    assert chi_squared_limit(freedom, 4.0) == pytest.approx(exact, rel=0.1)


def test_noise_about_a_steady_drift_is_not_taken_for_more() -> None:
    seen = [scatter_ratio(*levels(seed, 1.0), np.full(9, U)) > 1 for seed in range(500)]
    assert sum(seen) <= 3


def test_a_scatter_beyond_noise_is_seen_with_its_size() -> None:
    found = [scatter_ratio(*levels(seed, 5.0), np.full(9, U)) for seed in range(100)]
    assert np.median(found) == pytest.approx(5.0, rel=0.15)
    assert np.mean(np.array(found) > 1.5) > 0.9


def test_few_checks_tell_nothing() -> None:
    assert scatter_ratio(*levels(1, 5.0, 3), np.full(3, U)) == 1.0


def test_checks_that_scatter_count_in_the_level_and_in_each_point() -> None:
    steady, wandering = (
        Drift.of([check(t, level) for t, level in zip(*levels(1, n), strict=True)], 0)
        for n in (1.0, 5.0)
    )
    assert steady.scatter == 1.0
    assert steady.u_wander(300.0) == 0.0
    assert steady.u_relative == pytest.approx(U, rel=0.02)
    assert wandering.u_relative == pytest.approx(wandering.scatter * U, rel=0.02)
    expected = U * np.sqrt(wandering.scatter**2 - 1)
    assert wandering.u_wander(300.0) == pytest.approx(expected, rel=0.02)


def test_a_jump_of_the_lamp_is_no_scatter() -> None:
    times, level = levels(1, 1.0)
    level = level + 0.02 * (times > 300.0)
    drift = Drift.of([check(t, one) for t, one in zip(times, level, strict=True)], 0)
    assert drift.scatter == 1.0
    assert drift.u_between(np.array([310.0, 340.0])).any()


def test_the_ratio_of_noise_is_that_to_photons_read_out_and_rounding() -> None:
    level = CAMERA.black_level_dn + 2000.0
    gain = CAMERA.electrons_per_dn
    electrons = 2000.0 * gain + CAMERA.read_noise_electrons**2
    noise = np.sqrt((electrons / gain**2 + 1 / 12) / (4 * 1000.0))
    assert level < CAMERA.max_dn
    readings = [replace(check(0.0, 1.0), u_noise_dn=3 * noise)] * 3
    assert noise_ratio(readings, CAMERA) == pytest.approx(3.0)
    assert noise_ratio([], CAMERA) == 1.0
