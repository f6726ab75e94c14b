"""Minnaert's law: the printed formula, its limits, and energy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.models import MODELS
from instrument.geometry import Geometry
from tests.support.models.geometries import (
    special_directions,
)
from tests.support.models.reflectance import hemispherical_reflectance

ANGLE = st.floats(0.0, 89.0)
AZIMUTH = st.floats(0.0, 360.0)
PART = st.floats(0.0, 1.0)


@given(theta_i=ANGLE, theta_r=ANGLE, rho=PART, k=st.floats(0.0, 2.0))
def test_the_printed_formula(theta_i: float, theta_r: float, rho: float, k: float) -> None:
    i, r = math.radians(theta_i), math.radians(theta_r)
    expected = rho * (k + 1) / (2 * math.pi) * (math.cos(i) * math.cos(r)) ** (k - 1)
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=77)
    assert MODELS["minnaert"].brdf(geometry, albedo=rho, k=k) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("k", [0.3, 1.0, 1.7])
@pytest.mark.parametrize("theta_i", [0.0, 50.0, 80.0])
def test_it_reflects_its_albedo_times_a_power(theta_i: float, k: float) -> None:
    expected = 0.6 * math.cos(math.radians(theta_i)) ** (k - 1)
    found = hemispherical_reflectance("minnaert", theta_i, azimuths=1, albedo=0.6, k=k)
    assert found == pytest.approx(expected, rel=1e-4)


def test_limits_of_validity() -> None:
    model, geometry = MODELS["minnaert"], Geometry.from_degrees(theta_i=0, theta_r=[0, 59, 61, 90])
    # albedo 0.5, k = 0: as much leaves as arrives where cos(theta) = 0.5
    dark = model.validity(geometry, albedo=0.5, k=0.0)
    assert list(dark.mask) == [True, True, False, False]
    assert "oblique" in dark.reason
    beyond = model.validity(geometry, albedo=0.5, k=1.2)
    assert not beyond.mask.any()
    assert "0 to 1" in beyond.reason
    lambert = model.validity(geometry, albedo=1.0, k=1.0)
    assert lambert.mask.all()
    assert lambert.reason == ""


def test_it_is_lamberts_law_at_k_1() -> None:
    geometry = special_directions(100, 90.0)
    for albedo in (0.0, 0.4, 1.0):
        found = MODELS["minnaert"].brdf(geometry, albedo=albedo, k=1.0)
        np.testing.assert_allclose(found, MODELS["lambert"].brdf(geometry, albedo=albedo))
