"""Levels: what rounding does to mean and variance, flicker, saturation."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.calibration.level_series import (
    ROUNDING_DN2,
    LevelSeries,
    flicker,
    flicker_estimate,
    rounding_of_mean_dn,
    rounding_of_variance_dn2,
    unsaturated,
)
from tests.support.calibration.sensor_model import SensorModel, level_series


@pytest.mark.parametrize("noise_dn", [0.25, 0.35, 0.5])
def test_the_u_of_rounding_is_the_spread_over_places_between_two_counts(noise_dn: float) -> None:
    """Rounding of normal values integrated over a fine grid, for means all over one count."""
    places = np.linspace(0, 1, 41)[:-1]
    grid = np.linspace(-6, 6, 4001)
    weights = np.exp(-(grid**2) / 2)
    weights /= weights.sum()
    counts = np.rint(places[:, None] + noise_dn * grid)
    mean = counts @ weights
    variance = (counts**2) @ weights - mean**2
    whole = np.array([noise_dn**2 + ROUNDING_DN2])
    u_mean, u_variance = rounding_of_mean_dn(whole)[0], rounding_of_variance_dn2(whole)[0]
    assert np.std(mean - places) == pytest.approx(u_mean, rel=0.05)
    assert np.std(variance - whole) == pytest.approx(u_variance, rel=0.25)


def test_flicker_and_wander_are_those_of_the_frames() -> None:
    model = SensorModel(flicker=0.002)
    lit, dark = model.levels(28, 4)
    relative, wander = flicker(lit.chosen(np.arange(21)), dark)
    assert relative == pytest.approx(0.002, rel=0.3)
    assert wander < 0.02


@pytest.mark.parametrize("true", [0.0, 0.001, 0.004])
def test_the_u_of_a_flicker_is_its_spread_over_series(true: float) -> None:
    """Scatter of frames' means about 1500 DN; pixel noise alone gives 0.3 DN."""
    rng, found = np.random.default_rng(12), []
    for _ in range(150):
        own = np.hypot(0.3, true * 1500) * rng.standard_normal((40, 4))
        series = LevelSeries(
            exposure_s=np.ones(40), mean_dn=np.full(40, 1564.0), variance_dn2=np.full(40, 360.0),
            scatter_dn2=own.var(axis=1, ddof=1), frames=np.full(40, 4.0), age_s=np.arange(40.0),
            pixels=4000,
        )  # fmt: skip
        found.append(flicker_estimate(series, 0.0, 64.0))
    values, us = np.array(found).T
    if true == 0:
        assert np.all(values < 2.5 * us)
        assert values.max() < 2e-4
    else:
        assert values.mean() == pytest.approx(true, rel=0.02)
        assert np.std(values) == pytest.approx(us.mean(), rel=0.2)


@pytest.mark.parametrize("well", [30_000.0, 20_000.0])
def test_levels_near_a_limit_are_left_out(well: float) -> None:
    """A limit of the converter, and one of the well at two thirds of its range."""
    model = SensorModel()
    exposures = np.linspace(0.05, 1.3, 26) * model.full_s
    frames = [np.minimum(model.stack(e, 2, lit=True), 64 + well * model.gain) for e in exposures]
    kept = unsaturated(level_series(exposures, frames), model.max_dn, 64.0)
    reached = 0.97 * exposures[kept].max() / model.full_s * 30_000 / well
    assert 0.8 < reached < 0.97
    assert np.all(kept[: np.count_nonzero(kept)])
