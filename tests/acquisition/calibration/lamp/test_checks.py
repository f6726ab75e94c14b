"""Refusal of readings: a lamp that warms up never counts as one that jumped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.calibration.lamp.checks import require_lamp, require_lit_tile
from analysis.calibration.level_series import LevelSeries
from instrument.errors import DeviceError, NotDetermined
from instrument.geometry import FloatArray


def readings(signal: FloatArray, scatter_dn: float, every_s: float = 10.0) -> LevelSeries:
    size = signal.size
    return LevelSeries(
        exposure_s=np.full(size, 0.02), mean_dn=signal + 64, variance_dn2=np.full(size, 300.0),
        scatter_dn2=np.full(size, scatter_dn**2), frames=np.full(size, 4.0),
        age_s=every_s * np.arange(size), pixels=4000,
    )  # fmt: skip


def require_each(signal: FloatArray, scatter_dn: float) -> None:
    """Check after each reading, as a watch does."""
    for end in range(1, signal.size + 1):
        require_lamp(readings(signal[:end], scatter_dn), signal[:end])


def test_random_warm_ups_do_not_jump_and_steps_in_them_do() -> None:
    rng = np.random.default_rng(7)
    for _ in range(40):
        age = 10 * np.arange(40.0)
        flicker = float(rng.choice([0.0, 1e-3, 5e-3]))
        warm_up, tau_s = rng.uniform(-0.5, 0.8), rng.uniform(3, 400)
        level = 1500 * (1 - warm_up * np.exp(-age / tau_s)) * (1 + rng.normal(0, 0.02) * age / 3600)
        signal = level * (1 + flicker / 2 * rng.standard_normal(40))
        require_each(signal, flicker * 1500)
        at = int(rng.integers(20, 40))
        trend = abs(float(level[at] / level[at - 1] - 1))
        size = float(rng.choice([-1, 1])) * (0.02 + 16 * flicker + 4 * trend)
        signal[at:] *= 1 + size
        with pytest.raises(DeviceError, match=rf"jumped by .* {10 * at} s after the start"):
            require_each(signal, flicker * 1500)


def test_a_lamp_that_dies_is_named_at_any_reading() -> None:
    for at in (1, 2, 9):
        signal = np.where(np.arange(10) < at, 1500.0, 3.0)
        with pytest.raises(DeviceError, match=rf"went out {10 * at} s .*from 1500 to 3 DN"):
            require_each(signal, 0.5)


def test_a_shadow_on_the_tile_is_refused() -> None:
    require_lit_tile(np.linspace(0.6, 1.1, 100), 45.0)
    with pytest.raises(NotDetermined, match="the light falls to 10 % of the usual; needed: 50 %"):
        require_lit_tile(np.where(np.arange(100) < 10, 0.1, 1.0), 45.0)


def test_the_noise_of_few_readings_of_two_frames_is_no_jump() -> None:
    rng = np.random.default_rng(8)
    for _ in range(2000):
        frames = 1500 * (1 + 0.01 * rng.standard_normal((5, 2)))
        signal, scatter = frames.mean(axis=1), frames.var(axis=1, ddof=1)
        for end in (3, 4, 5):
            taken = replace(
                readings(signal[:end], 0.0), scatter_dn2=scatter[:end], frames=np.full(end, 2.0)
            )
            require_lamp(taken, signal[:end])
