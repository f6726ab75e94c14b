"""Single scattering: its phase function and its limits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.models import MODELS
from instrument.geometry import Geometry

ANGLE = st.floats(0.0, 89.0)
MODEL = MODELS["single_scattering"]


@given(theta_i=ANGLE, theta_r=ANGLE, dphi=st.floats(0, 360))
def test_isotropic_particles_are_the_dark_limit_of_a_half_space(
    theta_i: float, theta_r: float, dphi: float
) -> None:
    """Wolff's model at n = 1 is Chandrasekhar's law: dark particles scatter once only."""
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    all_orders = MODELS["wolff"].brdf(geometry, single_scattering_albedo=1e-9, n=1.0)
    assert MODEL.brdf(geometry, scattering=1e-9, asymmetry=0.0) == pytest.approx(
        all_orders, rel=1e-7
    )


@pytest.mark.parametrize("asymmetry", [-0.9, -0.3, 0.0, 0.6])
def test_the_phase_function_has_mean_1_and_its_mean_cosine_is_the_asymmetry(
    asymmetry: float,
) -> None:
    """With lamp and camera at 89.99999 degrees, gamma runs over a great circle with dphi; with
    weights sin(gamma)/2 that is the sphere. The mean of cos(pi - gamma) is g (Henyey, 1941).
    """
    x, w = np.polynomial.legendre.leggauss(400)
    gamma_deg = np.degrees(np.arccos(x))
    graze = 90 - 1e-6
    geometry = Geometry.from_degrees(theta_i=graze, theta_r=graze, dphi=gamma_deg)
    cosines = 2 * np.cos(np.radians(graze))
    phase = MODEL.brdf(geometry, scattering=1.0, asymmetry=asymmetry) * 4 * np.pi * cosines
    assert w @ phase / 2 == pytest.approx(1.0, abs=1e-6)
    assert w @ (phase * -x) / 2 == pytest.approx(asymmetry, abs=1e-6)


@pytest.mark.parametrize(("asymmetry", "brighter"), [(-0.5, 1), (0.5, -1), (0.0, 0)])
def test_negative_asymmetry_scatters_to_the_lamp_and_positive_to_the_mirror_side(
    asymmetry: float, brighter: int
) -> None:
    sides = Geometry.from_degrees(theta_i=50.0, theta_r=[40.0, -40.0])
    lamp, mirror = MODEL.brdf(sides, scattering=0.5, asymmetry=asymmetry)
    assert np.sign(round(float(lamp - mirror), 12)) == brighter


def test_validity_ends_at_scattering_1_and_at_grazing() -> None:
    geometry = Geometry.from_degrees(theta_i=[30.0, 90.0], theta_r=[30.0, 90.0])
    valid = MODEL.validity(geometry, scattering=1.0, asymmetry=0.0)
    assert valid.mask.tolist() == [True, False]
    assert "graze" in valid.reason
    bright = MODEL.validity(geometry, scattering=1.1, asymmetry=0.0)
    assert not bright.mask.any()
    assert "above 1" in bright.reason
