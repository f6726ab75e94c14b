"""A gamma is named, a residual non-linearity is measured, a proportional camera stays so."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from analysis.calibration.camera_fit import CameraFit, fit_camera
from tests.support.calibration.sensor_model import Array, SensorModel


def gamma(exponent: float) -> Callable[[Array], Array]:
    return lambda share: np.asarray(np.maximum(share, 0) ** (1 / exponent))


def srgb(share: Array) -> Array:
    """IEC 61966-2-1, forward."""
    light = np.maximum(share, 0)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def bt709(share: Array) -> Array:
    """Rec. ITU-R BT.709-6, item 1.2."""
    light = np.maximum(share, 0)
    return np.where(light < 0.018, 4.5 * light, 1.099 * light**0.45 - 0.099)


def fit_of(curve: Callable[[Array], Array]) -> tuple[SensorModel, CameraFit]:
    model = SensorModel(curve=curve)
    return model, fit_camera(*model.levels(22), model.max_dn)


@pytest.mark.parametrize(
    ("curve", "name"),
    [
        (gamma(2.2), "gamma 2.2"),
        (gamma(1 / 0.9), "gamma 1.11"),
        (srgb, "sRGB curve"),
        (bt709, "ITU-R BT.709 curve"),
    ],
    ids=["2.2", "0.9", "sRGB", "BT.709"],
)
def test_a_gamma_is_named_and_inverted(curve: Callable[[Array], Array], name: str) -> None:
    model, fit = fit_of(curve)
    assert fit.response.curve.name == name
    assert fit.response.curve.is_video
    light = np.linspace(0.1, 0.9, 9)
    counts = model.black_dn + curve(light) * (model.max_dn - model.black_dn)
    found = fit.response.light(counts) / light
    assert np.ptp(found) / found.mean() < 0.005
    assert fit.transfer.gain_dn_per_electron.value == pytest.approx(model.gain, rel=0.02)
    assert fit.transfer.dark_noise_electrons is None  # cut off at black


@pytest.mark.parametrize("excess", [0.01, 0.005, -0.01])
def test_a_residual_non_linearity_is_measured(excess: float) -> None:
    model, fit = fit_of(lambda share: share + excess * share * (1 - share))
    assert fit.response.curve.name == "residual non-linearity"
    assert fit.response.nonlinearity() == pytest.approx(0.9 * abs(excess), rel=0.15)
    light = np.linspace(0.1, 0.9, 9)
    counts = model.black_dn + model.curve(light) * (model.max_dn - model.black_dn)
    found = fit.response.light(counts) / light
    assert np.ptp(found) < 0.1 * abs(excess)
    assert fit.response.residual_relative < 0.002


def test_a_proportional_camera_gets_no_curve() -> None:
    _, fit = fit_of(lambda share: share)
    assert fit.response.curve.name == "proportional"
    assert fit.response.nonlinearity() == 0.0


def test_a_bend_that_flicker_hides_is_part_of_u() -> None:
    """Flicker of 0.3 % in two frames leaves a bend of some 0.1 % open, chosen or not."""
    model = SensorModel(flicker=0.003)
    fit = fit_camera(*model.levels(20), model.max_dn)
    assert fit.response.curve.name == "proportional"
    assert 5e-4 < fit.response.u_light_relative < 5e-3


def test_a_shutter_that_opens_too_long_is_no_non_linearity() -> None:
    """Exposures that are all 0.2 ms longer than set only shift the level at exposure 0."""
    model = SensorModel()
    lit, dark = model.levels(20)
    set_s = lit.exposure_s - 0.0002
    fit = fit_camera(replace(lit, exposure_s=set_s), dark, model.max_dn)
    assert fit.response.curve.name == "proportional"
    per_s = fit.response.rate_per_s * fit.response.span_dn
    assert (fit.response.black_dn - model.black_dn) / per_s == pytest.approx(0.0002, rel=0.05)
