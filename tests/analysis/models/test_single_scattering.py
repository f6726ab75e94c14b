"""Light scattered once inside: its phase function and limits; GGX with strengths of its own."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.models import MODELS
from instrument.geometry import Geometry

ANGLE = st.floats(0.0, 89.0)
ONCE, GGX, GGX_F90 = MODELS["single_scattering"], MODELS["ggx"], MODELS["ggx_f90"]


@given(theta_i=ANGLE, theta_r=ANGLE, dphi=st.floats(0, 360))
def test_particles_without_preference_are_the_dark_limit_of_a_half_space(
    theta_i: float, theta_r: float, dphi: float
) -> None:
    """Wolff's model at n = 1 is Chandrasekhar's law: of black particles one bounce is left."""
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    all_orders = MODELS["wolff"].brdf(geometry, single_scattering_albedo=1e-9, n=1.0)
    assert ONCE.brdf(geometry, scattering=1e-9, asymmetry=0.0) == pytest.approx(
        all_orders, rel=1e-7
    )


@pytest.mark.parametrize("asymmetry", [-0.9, -0.3, 0.0, 0.6])
def test_the_phase_function_has_the_mean_1_and_turns_light_by_its_asymmetry(
    asymmetry: float,
) -> None:
    """Of lamp and camera at 89.99999 degrees on all azimuths gamma runs over a great circle; with
    weights sin(gamma)/2 that is the sphere. The mean of cos(pi - gamma) is g (Henyey, 1941).
    """
    x, w = np.polynomial.legendre.leggauss(400)
    gamma_deg = np.degrees(np.arccos(x))
    graze = 90 - 1e-6
    geometry = Geometry.from_degrees(theta_i=graze, theta_r=graze, dphi=gamma_deg)
    cosines = 2 * np.cos(np.radians(graze))
    phase = ONCE.brdf(geometry, scattering=1.0, asymmetry=asymmetry) * 4 * np.pi * cosines
    assert w @ phase / 2 == pytest.approx(1.0, abs=1e-6)
    assert w @ (phase * -x) / 2 == pytest.approx(asymmetry, abs=1e-6)


@pytest.mark.parametrize(("asymmetry", "brighter"), [(-0.5, 1), (0.5, -1), (0.0, 0)])
def test_backward_particles_shine_to_the_lamp_and_forward_ones_to_the_mirror_side(
    asymmetry: float, brighter: int
) -> None:
    sides = Geometry.from_degrees(theta_i=50.0, theta_r=[40.0, -40.0])
    lamp, mirror = ONCE.brdf(sides, scattering=0.5, asymmetry=asymmetry)
    assert np.sign(round(float(lamp - mirror), 12)) == brighter


def test_where_more_would_leave_than_comes_neither_holds() -> None:
    geometry = Geometry.from_degrees(theta_i=[30.0, 90.0], theta_r=[30.0, 90.0])
    sound = ONCE.validity(geometry, scattering=1.0, asymmetry=0.0)
    assert sound.mask.tolist() == [True, False]
    assert "graze" in sound.reason
    bright = ONCE.validity(geometry, scattering=1.1, asymmetry=0.0)
    assert not bright.mask.any()
    assert "above 1" in bright.reason
    assert GGX_F90.validity(geometry, f0=1.0, f90=1.0, alpha=0.3).mask.tolist() == [True, False]
    strong = GGX_F90.validity(geometry, f0=0.1, f90=2.0, alpha=0.3)
    assert not strong.mask.any()
    assert "strength above 1" in strong.reason


@given(theta_i=ANGLE, theta_r=ANGLE, dphi=st.floats(0, 360), f0=st.floats(0, 1))
def test_ggx_with_a_grazing_strength_of_1_is_ggx(
    theta_i: float, theta_r: float, dphi: float, f0: float
) -> None:
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    found = GGX_F90.brdf(geometry, f0=f0, f90=1.0, alpha=0.3)
    assert found == pytest.approx(float(GGX.brdf(geometry, f0=f0, alpha=0.3)), rel=1e-12)


def test_ggx_s_strengths_are_those_at_the_two_ends() -> None:
    """theta' = 0 looking along the lamp's ray; theta' near 90 degrees from grazing to grazing."""
    facing = Geometry.from_degrees(theta_i=20.0, theta_r=20.0, dphi=0.0)
    across = Geometry.from_degrees(theta_i=89.9999, theta_r=89.9999, dphi=180.0)
    for geometry, f0, f90 in ((facing, 0.3, 0.0), (across, 0.0, 0.3)):
        found = GGX_F90.brdf(geometry, f0=f0, f90=f90, alpha=0.4)
        whole = GGX_F90.brdf(geometry, f0=1.0, f90=1.0, alpha=0.4)
        assert found / whole == pytest.approx(0.3, rel=1e-4)
