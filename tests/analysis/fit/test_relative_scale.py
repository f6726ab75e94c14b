"""Relative measurements: the shape of the model is determined, its scale is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.data.measurements import Measurements
from analysis.fit.fit import fit
from analysis.fit.relative_scale import FACTOR_NAME, normalise_lamp_levels, relative_model
from analysis.models import MODELS
from instrument.geometry import FloatArray, Geometry
from tests.support.analysis.seeded_scan import noise_free

TRUTH = {"albedo": 0.8, "sigma_deg": 30.0}
MODEL = MODELS["oren_nayar_qualitative"]


def scaled(factor: float | FloatArray) -> Measurements:
    m = noise_free(MODEL.name, TRUTH)
    assert m.u_random is not None
    return replace(m, brdf=m.brdf * factor, u_random=m.u_random * factor, relative=True)


@pytest.mark.parametrize("factor", [1e-3, 1e5])
def test_the_roughness_is_found_in_any_unit_and_the_albedo_is_not(factor: float) -> None:
    found = fit(MODEL, scaled(factor))
    assert found.values["sigma_deg"] == pytest.approx(30.0, rel=1e-4)
    assert found.u["sigma_deg"] is not None
    assert found.u["albedo"] is None
    assert {"albedo", FACTOR_NAME} <= set(found.undetermined)


def test_lamp_levels_are_normalised_to_the_model() -> None:
    levels = np.array([1.0, 3.0, 0.2])
    m = noise_free(MODEL.name, TRUTH)
    m = replace(scaled(levels[m.lamp_setting]), free_levels=True)

    def brdf(geometry: Geometry) -> FloatArray:
        return MODEL.brdf(geometry, **TRUTH)

    found = normalise_lamp_levels(m, brdf)
    np.testing.assert_allclose(found.brdf, brdf(m.geometry), rtol=1e-12)
    assert normalise_lamp_levels(replace(m, free_levels=False), brdf).brdf is m.brdf


def test_no_light_is_an_error() -> None:
    with pytest.raises(ValueError, match="mean of the relative values = 0"):
        relative_model(MODEL, np.zeros(3))
