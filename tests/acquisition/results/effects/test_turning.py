"""Blur in angle as a part of u: the mean over a frame against its middle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.results.effects.turning import smear, turning_errors, turning_note
from instrument.geometry import FloatArray
from instrument.record.reading import Reading

POINT = Reading(
    step=0, kind="point", surface="sample", theta_i_deg=30.0, dphi_deg=0.0, theta_r_deg=0.0,
    lamp_setting=0, block=0, signal_dn=100.0, u_noise_dn=1.0, u_quantisation_dn=0.1, u_dark_dn=0.1,
    u_placement_dn=0.0, u_texture_dn=0.0, exposure_s=0.1, frames=1, window_pixels=10.0,
    saturated_pixels=0, peak_dn=200.0, time_s=0.0, free_s=0.0, time_utc="", flags="",
)  # fmt: skip


def readings(angles: FloatArray, blur_deg: float, setting: int = 0) -> list[Reading]:
    return [
        replace(POINT, theta_r_deg=float(a), blur_deg=blur_deg, lamp_setting=setting)
        for a in angles
    ]


def test_of_a_parabola_it_is_exact_in_any_order() -> None:
    random = np.random.default_rng(3)
    for _ in range(20):
        angles, blur = np.sort(random.uniform(-80, 80, 12)), float(random.uniform(0.1, 3.0))
        a, b = random.uniform(5, 9), random.normal() / 1e4
        value = a + b * angles**2
        order = random.permutation(12)
        found = smear(readings(angles[order], blur), value[order])
        assert found == pytest.approx(np.abs(b) * blur**2 / 12 / value[order], rel=1e-6)


def test_it_covers_the_loss_at_the_peak_of_a_lobe() -> None:
    """Frames close to one another, as a flight takes them; the mean by a sum."""
    random = np.random.default_rng(4)
    for _ in range(20):
        sigma = float(random.uniform(0.8, 20.0))
        blur = float(random.uniform(0.05, 0.5)) * sigma
        angles = np.arange(-30, 31) * 1.3 * blur
        value = 1 + 3 * np.exp(-((angles / sigma) ** 2) / 2)
        within = np.linspace(-0.5, 0.5, 2001) * blur
        lost = value[30] - np.mean(1 + 3 * np.exp(-((within / sigma) ** 2) / 2))
        assert smear(readings(angles, blur), value)[30] * value[30] == pytest.approx(lost, rel=0.2)


def test_each_setting_of_the_lamp_has_its_own_curve() -> None:
    angles = np.linspace(0.0, 50.0, 6)
    both = [*readings(angles, 1.0), *readings(angles, 1.0, setting=1)]
    value = np.concatenate([np.full(6, 1.0), np.full(6, 5.0)])
    assert smear(both, value) == pytest.approx(np.zeros(12), abs=1e-12)


def test_frames_at_rest_have_neither() -> None:
    still = readings(np.arange(5.0), 0.0)
    assert turning_errors(still, np.ones(5)) == ({}, ())
    assert turning_note(still) == ""
