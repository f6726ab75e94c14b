"""Relative measurements: the shape of the model is determined, its scale is not."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.data.measurements import Measurements
from analysis.fit.fit import FitResult, fit
from analysis.fit.relative_scale import normalise_lamp_levels, relative_model
from analysis.models import MODELS
from instrument.geometry import FloatArray, Geometry
from tests.support.analysis.seeded_scan import noise_free, noisy_sweeps

THETA_I, THETA_R = (
    a.ravel()
    for a in np.meshgrid([15.0, 30.0, 45.0, 60.0], np.arange(-75.0, 76.0, 5.0), indexing="ij")
)
TRUTH = {"albedo": 0.8, "sigma_deg": 30.0}
MODEL = MODELS["oren_nayar_qualitative"]


def scaled(factor: float | FloatArray) -> Measurements:
    m = noise_free(MODEL.name, TRUTH)
    assert m.u_random is not None
    return replace(m, brdf=m.brdf * factor, u_random=m.u_random * factor, relative=True)


def test_lamp_levels_are_normalised_to_the_model() -> None:
    levels = np.array([1.0, 3.0, 0.2])
    m = noise_free(MODEL.name, TRUTH)
    m = replace(scaled(levels[m.lamp_setting]), free_levels=True)

    def brdf(geometry: Geometry) -> FloatArray:
        return MODEL.brdf(geometry, **TRUTH)

    found = normalise_lamp_levels(m, brdf)
    np.testing.assert_allclose(found.brdf, brdf(m.geometry), rtol=1e-12)
    assert normalise_lamp_levels(replace(m, free_levels=False), brdf).brdf is m.brdf


@pytest.mark.parametrize("dark", ["model", "sample"])
def test_a_lamp_setting_at_which_all_is_dark_keeps_its_level(dark: str) -> None:
    """A narrow lobe may send nothing into any view of one setting."""
    m = noise_free(MODEL.name, TRUTH)
    unlit = m.lamp_setting == 1
    levels = np.array([1.0, 3.0, 0.2])[m.lamp_setting]
    if dark == "sample":
        levels = np.where(unlit, 0.0, levels)
    u_random = np.full(m.size, 1e-3)
    m = replace(m, brdf=m.brdf * levels, u_random=u_random, relative=True, free_levels=True)

    def brdf(geometry: Geometry) -> FloatArray:
        return np.where(unlit & (dark == "model"), 0.0, MODEL.brdf(geometry, **TRUTH))

    found = normalise_lamp_levels(m, brdf)
    assert found.brdf[unlit] == pytest.approx(m.brdf[unlit], rel=1e-12)
    assert found.brdf[~unlit] == pytest.approx(noise_free(MODEL.name, TRUTH).brdf[~unlit])


def test_no_light_is_an_error() -> None:
    with pytest.raises(ValueError, match="mean of the relative values = 0"):
        relative_model(MODEL, np.zeros(3))


@pytest.mark.parametrize(
    ("name", "truth"),
    [
        ("oren_nayar_qualitative", TRUTH),
        ("oren_nayar", TRUTH),
        ("oren_nayar_exact", TRUTH),
        ("oren_nayar+torrance_sparrow", TRUTH | {"ks": 0.3}),
    ],
)
def test_a_relative_scan_determines_the_roughness_and_no_scale(
    name: str, truth: dict[str, float]
) -> None:
    m = noisy_sweeps(name, THETA_I, THETA_R, 3, **truth)
    assert m.u_random is not None
    counts = replace(m, brdf=5e3 * m.brdf, u_random=5e3 * m.u_random, relative=True)
    found = fit(MODELS[name], counts)
    scales = {"albedo", "ks", "per_brdf"} & set(found.values)
    for scale in scales:
        assert found.u[scale] is None
        assert scale in found.undetermined
    assert found.values["sigma_deg"] == pytest.approx(30.0, abs=4 * (found.u["sigma_deg"] or 0))
    low, high = found.intervals["per_brdf"]
    assert low <= 5e3 <= high
    # The absolute scan determines the roughness at least as well.
    absolute = fit(MODELS[name], m).u["sigma_deg"]
    assert absolute is not None
    assert absolute < 1.1 * (found.u["sigma_deg"] or np.inf)


@cache
def relative_scan() -> tuple[Measurements, FitResult]:
    m = noisy_sweeps("oren_nayar", THETA_I, THETA_R, 3, **TRUTH)
    return m, fit(MODELS["oren_nayar"], replace(m, relative=True))


@given(exponent=st.floats(-9, 9))
@settings(max_examples=4)
def test_the_unit_of_a_relative_scan_has_no_effect(exponent: float) -> None:
    m, one = relative_scan()
    assert m.u_random is not None
    factor = 10.0**exponent
    scaled = replace(m, brdf=factor * m.brdf, u_random=factor * m.u_random, relative=True)
    other = fit(MODELS["oren_nayar"], scaled)
    assert other.chi2 == pytest.approx(one.chi2, rel=1e-6)
    u = one.u["sigma_deg"]
    assert u is not None
    assert abs(other.values["sigma_deg"] - one.values["sigma_deg"]) < 1e-2 * u
    assert other.u["sigma_deg"] == pytest.approx(u, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("stated", [True, False], ids=["u stated", "no u"])
def test_unknown_levels_of_the_lamp_leave_the_shape_of_each_incidence(
    stated: bool, slow: bool
) -> None:
    """A level free by its whole value would let any model pass at a chi2 of 1 for each level."""
    m = noise_free(MODEL.name, TRUTH)
    levels = np.array([1000.0, 1700.0, 800.0, 900.0])[m.lamp_setting]
    inside = 0
    seeds = range(8 if slow else 4)
    for seed in seeds:
        noise = 1 + 0.005 * np.random.default_rng([13, seed]).standard_normal(m.size)
        data = replace(
            m,
            brdf=m.brdf * noise * levels,
            u_random=0.005 * m.brdf * levels if stated else None,
            relative=True,
            free_levels=True,
        )
        found = fit(MODEL, data)
        low, high = found.intervals.get("sigma_deg", (0.0, 0.0))
        u = found.u["sigma_deg"]
        assert "sigma_deg" not in found.undetermined
        inside += low <= 30 <= high if u is None else abs(found.values["sigma_deg"] - 30) < 3 * u
        assert found.rms_relative < 0.01 or stated
    assert inside >= len(seeds) - 1
