"""EON: the published formula, its limits, and energy."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.models import MODELS
from analysis.models.eon import directional_albedo
from instrument.geometry import FloatArray, Geometry
from tests.support.models.reflectance import hemispherical_reflectance

ANGLE = st.floats(0.0, 89.0)
AZIMUTH = st.floats(0.0, 360.0)
PART = st.floats(0.0, 1.0)

_T, _W = np.polynomial.legendre.leggauss(120)


def printed_eon(i: float, r: float, dphi: float, rho: float, rough: float) -> float:
    """EON typed from the paper: FON with A_F, B_F, the exact albedo E_F, and the lobe f_ms."""
    mu_i, mu_o = math.cos(i), math.cos(r)
    s = math.sin(i) * math.sin(r) * math.cos(dphi)
    s_over_t = s / max(mu_i, mu_o) if s > 0 else s
    A = 1 / (1 + (1 / 2 - 2 / (3 * math.pi)) * rough)

    def E(mu: float) -> float:  # noqa: N802 - the source's symbol
        S = math.sqrt(1 - mu * mu)
        G = S * (math.acos(mu) - S * mu) + 2 / 3 * (S / mu * (1 - S**3) - S)
        return A + rough * A / math.pi * G

    mean = A * (1 + (2 / 3 - 28 / (15 * math.pi)) * rough)
    rho_ms = rho**2 * mean / (1 - rho * (1 - mean))
    single = rho / math.pi * A * (1 + rough * s_over_t)
    return single + rho_ms / math.pi * (1 - E(mu_i)) * (1 - E(mu_o)) / (1 - mean)


@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, rho=PART, rough=st.floats(0.01, 1.0))
def test_the_published_formula(
    theta_i: float, theta_r: float, dphi: float, rho: float, rough: float
) -> None:
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    found = MODELS["eon"].brdf(geometry, albedo=rho, roughness=rough)
    expected = printed_eon(*map(math.radians, (theta_i, theta_r, dphi)), rho, rough)
    assert found == pytest.approx(expected, rel=1e-10, abs=1e-13)


def halves(function: Callable[[FloatArray], FloatArray], kink: float) -> float:
    """Integral over theta from 0 to pi/2, in two panels that meet at the kink."""
    total = 0.0
    for a, b in ((0.0, kink), (kink, np.pi / 2)):
        theta = a + (b - a) * (_T + 1) / 2
        total += float((b - a) / 2 * _W @ function(theta))
    return total


@pytest.mark.parametrize("roughness", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("theta_i", [0.0, 30.0, 60.0, 85.0, 90.0])
def test_a_white_surface_reflects_all_light(theta_i: float, roughness: float) -> None:
    # Kinks of s/t: at dphi = 90 degrees (a panel's end) and at theta_r = theta_i.
    p, wp = np.polynomial.legendre.leggauss(20)
    dphi = np.concatenate([45 * (p + 1), 90 + 45 * (p + 1)])

    def ring(theta: FloatArray) -> FloatArray:
        geometry = Geometry.from_degrees(
            theta_i=theta_i, theta_r=np.degrees(theta)[:, np.newaxis], dphi=dphi
        )
        brdf = MODELS["eon"].brdf(geometry, albedo=1.0, roughness=roughness)
        return np.asarray(np.pi / 2 * (brdf @ np.tile(wp, 2)) * np.sin(theta) * np.cos(theta))

    assert halves(ring, math.radians(theta_i)) == pytest.approx(1, abs=1e-6)


def test_the_directional_albedo_is_the_integral_of_its_single_scattering() -> None:
    # f_ss = f in the limit of a small albedo, per albedo
    for theta_i in (0.0, 40.0, 80.0):
        single = hemispherical_reflectance("eon", theta_i, albedo=1e-9, roughness=0.8) * 1e9
        assert directional_albedo(np.radians(theta_i), 0.8) == pytest.approx(single, rel=1e-3)
    assert directional_albedo(np.array(np.pi / 2), 1.0) == pytest.approx(1, abs=1e-14)


@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, rho=PART)
def test_without_roughness_it_is_lambertian(
    theta_i: float, theta_r: float, dphi: float, rho: float
) -> None:
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    found = MODELS["eon"].brdf(geometry, albedo=rho, roughness=0.0)
    assert found == pytest.approx(rho / math.pi, rel=1e-14)


def test_validity_ends_where_lamp_and_camera_both_graze() -> None:
    geometry = Geometry.from_degrees(theta_i=90, theta_r=[0, 89.9, 90])
    model = MODELS["eon"]
    found = model.validity(geometry, **{p.name: p.default for p in model.parameters})
    assert list(found.mask) == [True, True, False]
    assert "graze" in found.reason
