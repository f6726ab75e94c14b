"""Predicted readings: those that a simulated scan then gives."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.design.predicted_readings import DARK, PredictedReadings
from acquisition.plan.plan import make_plan
from analysis.models import MODELS
from instrument.config.load import Loaded
from instrument.geometry import FloatArray, Geometry
from instrument.record.reading import Reading
from tests.support.scans import changed


def _predicted(loaded: Loaded) -> list[Reading]:
    sample = loaded.protocol.simulated_sample
    assert sample is not None

    def brdf(geometry: Geometry) -> FloatArray:
        return MODELS[sample.model].brdf(geometry, **sample.parameters)

    return PredictedReadings(loaded, make_plan(loaded)).of(brdf)


def test_the_readings_of_a_scan_are_as_predicted(small: Loaded, whole: list[Reading]) -> None:
    made = {reading.step: reading for reading in whole}
    for reading in _predicted(small):
        own = made[reading.step]
        angles = (own.theta_i_deg, own.dphi_deg, own.theta_r_deg)
        assert (reading.theta_i_deg, reading.dphi_deg, reading.theta_r_deg) == angles
        assert (reading.kind, reading.block, reading.flags) == (own.kind, own.block, "")
        assert reading.window_pixels == pytest.approx(own.window_pixels)
        rate, own_rate = (r.signal_dn / r.exposure_s for r in (reading, own))
        assert rate == pytest.approx(own_rate, rel=0.03)  # lamp, finite patch, mottling
        # One step of the ladder of exposures may lie between them.
        noise, own_noise = (r.u_noise_dn / r.signal_dn for r in (reading, own))
        assert noise == pytest.approx(own_noise, rel=0.25)


def test_the_effect_of_a_sample_off_the_axis_has_its_size_and_sign(
    small: Loaded, whole: list[Reading]
) -> None:
    """Texture, which is not known before, changes it, but not from one view to a far other one."""
    made = {reading.step: reading.u_placement_dn / reading.signal_dn for reading in whole}
    steep = [r for r in _predicted(small) if r.kind == "point" and abs(r.theta_r_deg) == 70]
    assert steep
    for reading in steep:
        own = made[reading.step]
        assert np.sign(reading.u_placement_dn) == np.sign(own)
        assert reading.u_placement_dn / reading.signal_dn == pytest.approx(own, rel=0.4)


def test_the_effect_of_texture_is_about_that_of_the_simulated_one(
    small: Loaded, whole: list[Reading]
) -> None:
    """It is random: over all steep views together it has its size within a factor."""
    steep = [r for r in _predicted(small) if r.kind == "point" and abs(r.theta_r_deg) == 70]
    predicted = [r.u_texture_dn / r.signal_dn for r in steep]
    steps = {r.step for r in steep}
    made = [r.u_texture_dn / r.signal_dn for r in whole if r.step in steps]
    ratio = float(np.linalg.norm(predicted) / np.linalg.norm(made))
    assert 1 / 4 < ratio < 4
    assert not [r for r in _predicted(small) if r.kind == "tile" and r.u_texture_dn]


def test_a_sample_without_light_is_flagged(small: Loaded) -> None:
    black = {"model": "lambert", "parameters": {"albedo": 0.0}}
    sample = small.protocol.simulated_sample
    assert sample is not None
    dark = changed(small, simulated_sample=sample.model_copy(update=black))
    for reading in _predicted(dark):
        assert reading.flags == ("" if reading.kind == "tile" else DARK)


def test_where_a_model_is_negative_that_is_flagged(small: Loaded) -> None:
    """The functional form of a rough dielectric is, at grazing views of a very rough one."""
    rough = {"albedo": 0.17, "sigma_deg": 39.8, "n": 1.49}
    sample = small.protocol.simulated_sample
    assert sample is not None
    rough_sample = sample.model_copy(update={"model": "wolff_oren_nayar", "parameters": rough})
    sweep = {"theta_i_deg": [60.0], "dphi_deg": [0.0], "theta_r_deg": [-80.0, 0.0, 60.0]}
    loaded = changed(small, simulated_sample=rough_sample, sweeps=[sweep])
    found = {r.theta_r_deg: r for r in _predicted(loaded) if r.kind == "point"}
    assert found[-80.0].signal_dn < 0 < found[0.0].signal_dn
    assert [r.theta_r_deg for r in found.values() if r.flags == DARK] == [-80.0]
    assert min(r.u_texture_dn for r in found.values()) >= 0
