"""Random sensors are recovered within their u; levels that say nothing are refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from analysis.calibration.camera_fit import CameraFit, fit_camera
from analysis.calibration.level_series import Estimate, LevelSeries
from instrument.errors import NotDetermined
from tests.support.calibration.sensor_model import Array, SensorModel, level_series

SHARES = np.linspace(0.1, 0.9, 17)


def bent(excess: float) -> Callable[[Array], Array]:
    return lambda share: share + excess * share * (1 - share)


def gamma(share: Array) -> Array:
    return np.asarray(np.maximum(share, 0) ** (1 / 2.2))


def random_sensor(seed: int) -> tuple[SensorModel, CameraFit]:
    """A sensor of 8 to 16 bit with read noise, dark current, bend and flicker, and its fit."""
    rng = np.random.default_rng([18, seed])
    bits, well = int(rng.choice([8, 10, 12, 16])), float(10 ** rng.uniform(3.7, 5))
    read, top = float(10 ** rng.uniform(0.3, 2)), 2**bits - 1
    black = max(top * rng.uniform(0.01, 0.05), 4 * read * top / well, 4.0)
    video = rng.random() < 0.15
    curve = gamma if video else bent(rng.uniform(-0.01, 0.01))
    model = SensorModel(
        bits=bits, well=well, read=read, dark_per_s=float(10 ** rng.uniform(0, 3.3)),
        black_dn=black, flicker=float(rng.choice([0.0, 0.001, 0.003])), random=rng,
        full_s=float(10 ** rng.uniform(-3, -0.3)), shading=float(rng.uniform(0, 0.1)),
        curve=curve, darks=3 * rng.standard_normal((50, 60)),
    )  # fmt: skip
    lit, dark = model.levels(int(rng.integers(14, 40)), int(rng.integers(2, 5)))
    return model, fit_camera(lit, dark, model.max_dn)


def pulls(model: SensorModel, fit: CameraFit) -> dict[str, float]:
    """(value - truth) / u of each quantity that is determined."""
    found, truth = fit.transfer, {
        "gain_dn_per_electron": model.gain,
        "dark_noise_electrons": model.read,
        "dark_current_electrons_per_s": model.dark_per_s,
        "full_well_electrons": model.well,
    }  # fmt: skip
    own: dict[str, float] = {}
    for name, true in truth.items():
        estimate: Estimate | None = getattr(found, name)
        if estimate is not None:
            own[name] = (estimate.value - true) / estimate.u
    counts = model.black_dn + model.curve(SHARES) * (model.max_dn - model.black_dn)
    wrong = np.log(fit.response.light(counts) / SHARES)
    own["light"] = float(np.sqrt(np.mean((wrong - wrong.mean()) ** 2)))
    own["light"] /= max(fit.response.u_light_relative, 1e-6)
    return own


@pytest.mark.slow
def test_random_sensors_are_recovered_within_their_u(slow: bool) -> None:
    """Limits of 3 sensors: 4.5 sigma each; of 300: the spread of the pulls too."""
    found: dict[str, list[float]] = {}
    for seed in range(300 if slow else 3):
        model, fit = random_sensor(seed)
        for name, pull in pulls(model, fit).items():
            found.setdefault(name, []).append(pull)
            assert abs(pull) < 4.5, (seed, name, pull)
    assert set(found) >= {"gain_dn_per_electron", "dark_noise_electrons", "light"}
    for name, values in found.items():
        spread = float(np.sqrt(np.mean(np.square(values))))
        assert spread < (1.2 if slow else 1.7), (name, spread)
        if slow:
            assert spread > 0.4, (name, spread)  # a u that is far too large is wrong as well


def test_the_u_is_small_enough_to_be_of_use() -> None:
    """3 000 pixels, 24 exposures of 2 frames, 12 bit: gain 0.8 %, read noise 1 %, light 0.02 %."""
    model = SensorModel()
    fit = fit_camera(*model.levels(), model.max_dn)
    gain, noise = fit.transfer.gain_dn_per_electron, fit.transfer.dark_noise_electrons
    assert noise is not None
    assert gain.u / gain.value < 0.008
    assert noise.u / noise.value < 0.01
    assert fit.response.u_light_relative < 2e-4


def test_a_dark_noise_below_rounding_is_an_interval_that_begins_at_0() -> None:
    model = SensorModel(bits=8, well=20_000.0, black_dn=8.0, darks=0.0, read=6.0)
    fit = fit_camera(*model.levels(), model.max_dn)
    noise = fit.transfer.dark_noise_electrons
    assert fit.transfer.dark_noise_is_rounding
    assert noise is not None
    assert noise.u / noise.value == pytest.approx(1 / np.sqrt(3), rel=1e-3)
    assert 0 < noise.value < 0.5 / model.gain


def test_a_camera_that_does_not_saturate_has_no_full_well() -> None:
    model = SensorModel()
    lit, dark = model.levels()
    below = lit.chosen(np.flatnonzero(lit.exposure_s < 0.8 * model.full_s))
    fit = fit_camera(below, dark, model.max_dn)
    assert fit.transfer.full_well_electrons is None
    assert fit.transfer.saturation_electrons is None
    assert fit.transfer.gain_dn_per_electron.value == pytest.approx(model.gain, rel=0.03)


def test_saturation_capacity_is_below_the_full_well_by_no_more_than_its_u() -> None:
    model = SensorModel(shading=0.0)
    transfer = fit_camera(*model.levels(40), model.max_dn).transfer
    assert transfer.saturation_electrons is not None
    assert transfer.full_well_electrons is not None
    most = transfer.full_well_electrons.value
    assert 0.93 * most < transfer.saturation_electrons.value < 1.01 * most


def test_flicker_of_the_lamp_is_told() -> None:
    model = SensorModel(flicker=0.003)
    fit = fit_camera(*model.levels(24, 4), model.max_dn)
    assert fit.flicker == pytest.approx(0.003, rel=0.3)


def test_a_drift_of_the_lamp_is_told_and_does_no_harm() -> None:
    """A lamp that gains 2 % during a series in random order: the camera stays proportional."""
    model = SensorModel()
    exposures, age_s = np.linspace(0.04, 0.9, 20) * model.full_s, model.random.permutation(20) * 1.0
    stacks = [
        model.stack(e * (1 + 0.001 * a), 2, lit=True) for e, a in zip(exposures, age_s, strict=True)
    ]
    _, dark = model.levels(8)
    fit = fit_camera(level_series(exposures, stacks, age_s), dark, model.max_dn)
    assert fit.drift == pytest.approx(0.019, abs=0.001)
    assert fit.response.nonlinearity() < 0.001


def levels_of(model: SensorModel, exposures: Array, shown_s: Array | None = None) -> LevelSeries:
    taken = exposures if shown_s is None else shown_s
    stacks = [model.stack(e, 2, lit=True) for e in taken]
    return level_series(exposures, stacks)


def test_noise_that_does_not_rise_with_the_light_is_refused() -> None:
    """Frames whose noise is that of the darks, as behind a filter that takes photon noise off."""
    model = SensorModel()
    lit, dark = model.levels(20)
    flat = replace(lit, variance_dn2=np.full(20, float(dark.variance_dn2[0])))
    with pytest.raises(NotDetermined, match=r"does not rise with the light: gain .* DN per elec"):
        fit_camera(flat, dark, model.max_dn)
    with pytest.raises(NotDetermined, match="its frames have no noise"):
        fit_camera(replace(lit, variance_dn2=np.zeros(20)), dark, model.max_dn)


@pytest.mark.parametrize(
    ("case", "words"),
    [
        ("lamp on", "the darks are not dark: at .* s they rise by .* DN.*Cover the lamp"),
        ("saturated", "4 of 12 exposures are below saturation; needed: 6"),
        ("few", "5 of 5 exposures are below saturation; needed: 6"),
        ("dim", "reaches 1.* % of full scale; needed: 50 %"),
        ("fixed", "its counts do not follow the exposure"),
    ],
)
def test_levels_that_determine_nothing_are_refused(case: str, words: str) -> None:
    model = SensorModel()
    full = model.full_s
    _, dark = model.levels(8)
    exposures = {
        "lamp on": np.linspace(0.05, 1.2, 12) * full,
        "saturated": np.linspace(0.2, 3.0, 12) * full,
        "few": np.linspace(0.05, 0.8, 5) * full,
        "dim": np.linspace(0.01, 0.15, 12) * full,
        "fixed": np.linspace(0.05, 0.8, 12) * full,
    }[case]
    lit = levels_of(model, exposures, np.full(12, 0.4 * full) if case == "fixed" else None)
    dark = lit if case == "lamp on" else dark
    with pytest.raises(NotDetermined, match=words):
        fit_camera(lit, dark, model.max_dn)
