"""Maps of pixels: dark offset and current, hot and deviant pixels, PRNU, DSNU, flat field."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.calibration.pixel_maps import (
    DarkMaps,
    Stack,
    dark_maps,
    dsnu,
    flat_maps,
    made_linear,
    prnu,
)
from analysis.calibration.response_fit import ResponseFit
from instrument.calibration.response_curve import GAMMA, ResponseCurve
from tests.support.calibration.sensor_model import SensorModel

SHAPE = (90, 110)
HOT = ((7, 9), (40, 80), (41, 80))


def stack_of(model: SensorModel, exposure_s: float, frames: int, *, lit: bool) -> Stack:
    taken = model.stack(exposure_s, frames, lit=lit)
    return Stack(
        exposure_s=exposure_s,
        mean_dn=taken.mean(axis=0),
        variance_dn2=taken.var(axis=0, ddof=1),
        frames=frames,
    )


def sensor(*, prnu_: float = 0.008, dsnu_: float = 6.0, bits: int = 12) -> SensorModel:
    rng = np.random.default_rng(5)
    factors = 1 + prnu_ * rng.standard_normal(SHAPE)
    factors[60, 20], factors[61, 90] = 0.0, 1.3  # dead, and far too bright
    hot = np.zeros(SHAPE)
    for place in HOT:
        hot[place] = 5_000.0
    return SensorModel(
        bits=bits, shape=SHAPE, factors=factors, darks=dsnu_ * rng.standard_normal(SHAPE),
        hot_per_s=hot, random=rng, black_dn=64.0 if bits > 8 else 8.0,
        read=8.0 if bits > 8 else 60.0,
    )  # fmt: skip


def response_of(model: SensorModel, curve: ResponseCurve) -> ResponseFit:
    """Known response of the model."""
    return ResponseFit(
        curve=curve, max_dn=model.max_dn, black_dn=model.black_dn, rate_per_s=1.0, drift_per_s=0.0,
        covariance=np.zeros((3, 3)), chi2_per_point=1.0, residual_relative=0.0,
        u_light_relative=0.0, low_dn=model.black_dn, high_dn=model.max_dn,
    )  # fmt: skip


def darks(model: SensorModel) -> DarkMaps:
    return dark_maps(stack_of(model, 0.01, 12, lit=False), stack_of(model, 2.0, 12, lit=False))


@pytest.mark.parametrize("bits", [8, 12])
def test_hot_pixels_are_found_and_no_others(bits: int) -> None:
    assert {tuple(p) for p in np.argwhere(darks(sensor(bits=bits)).hot).tolist()} == set(HOT)


def test_dark_maps_are_right_within_their_u() -> None:
    model = sensor()
    found = darks(model)
    current = (model.dark_per_s + np.asarray(model.hot_per_s)) * model.gain
    offset = model.black_dn + np.asarray(model.darks) * model.gain
    for values, u, truth in (
        (found.current_dn_per_s, found.u_current_dn_per_s, current),
        (found.offset_dn, found.u_offset_dn, offset),
    ):
        pull = ((values - truth) / u)[~found.hot]
        # Each pixel's u comes from 12 frames: the pulls have the t distribution of 11.
        assert np.sqrt(np.mean(pull**2)) == pytest.approx(np.sqrt(11 / 9), abs=0.08)
        assert abs(pull.mean()) < 0.05


def test_prnu_and_dsnu_are_those_of_the_sensor() -> None:
    model = sensor()
    lit, dark = (stack_of(model, 0.025, 16, lit=lit) for lit in (True, False))
    used = ~darks(model).hot
    used &= ~flat_maps(lit, dark.mean_dn, used, ~used, response_of(model, ResponseCurve())).deviant
    response, offset = prnu(lit, dark, used), dsnu(dark, used, model.gain)
    assert response.value == pytest.approx(0.008, abs=3 * response.u)
    assert offset.value == pytest.approx(6.0, abs=3 * offset.u)
    assert response.u < 2e-4
    assert offset.u < 0.1


def test_the_prnu_behind_a_gamma_is_that_of_the_light() -> None:
    """Counts themselves would show it smaller by the gamma."""
    model = sensor(dsnu_=0.0)
    model.curve = lambda share: np.asarray(np.maximum(share, 0) ** (1 / 2.2))
    gamma = response_of(model, ResponseCurve(GAMMA, (2.2,)))
    stacks = (stack_of(model, 0.025, 16, lit=lit) for lit in (True, False))
    lit, dark = (made_linear(stack, gamma) for stack in stacks)
    used = np.asarray(model.hot_per_s == 0) & (np.abs(np.asarray(model.factors) - 1) < 0.1)
    found = prnu(lit, dark, used)
    assert found.value == pytest.approx(0.008, abs=3 * found.u)


def test_a_sensor_without_differences_has_an_interval_from_0() -> None:
    model = SensorModel(shape=SHAPE)
    lit, dark = (stack_of(model, 0.025, 16, lit=lit) for lit in (True, False))
    found = prnu(lit, dark, np.ones(SHAPE, dtype=bool))
    assert found.value - 2 * found.u < 0.0003
    assert found.value < 0.002


def test_the_flat_field_is_that_of_the_pixels_and_not_of_the_light() -> None:
    model = sensor()
    lit, dark = (stack_of(model, 0.03, 16, lit=lit) for lit in (True, False))
    measured = np.ones(SHAPE, dtype=bool)
    measured[:, :20] = False  # the surface does not reach so far
    found = flat_maps(
        lit, dark.mean_dn, measured, darks(model).hot, response_of(model, ResponseCurve())
    )
    assert np.all(found.response[:, :20] == 1.0)
    assert {tuple(p) for p in np.argwhere(found.deviant).tolist()} == {(60, 20), (61, 90)}
    inner = found.measured & ~found.deviant
    inner[:, :28] = inner[:, -8:] = inner[:8] = inner[-8:] = False
    wrong = found.response[inner] / np.asarray(model.factors)[inner] - 1
    # Beside the noise, the mean of 15 x 15 neighbours has a PRNU of its own.
    expected = np.hypot(np.median(found.u_response[inner]), 0.008 / 15)
    assert np.std(wrong) == pytest.approx(expected, rel=0.1)
    assert abs(wrong.mean()) < 1e-3
