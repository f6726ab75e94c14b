"""Polarised lamp and camera: Fresnel on facets, and light of the body through the surface."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.models import MODELS
from instrument.config.simulated.sample import SimulatedSample
from instrument.geometry import FloatArray, Geometry
from sim.defects.mechanics import SeenAngles
from sim.defects.polarisation import INDEX, body_factor, facet_factor, polarised

SAMPLE = SimulatedSample(
    model="lambert+torrance_sparrow", parameters={"albedo": 0.4, "ks": 0.2, "sigma_deg": 20.0}
)
BREWSTER_DEG = float(np.degrees(np.arctan(INDEX)))
SHARES = st.floats(-0.2, 0.2)


def at(theta_i: float, theta_r: float, dphi: float) -> tuple[Geometry, SeenAngles]:
    """Geometry and axes, with a signed theta_r."""
    geometry = Geometry.from_degrees(theta_i=[theta_i], theta_r=[theta_r], dphi=[dphi])
    return geometry, SeenAngles(theta_i=theta_i, theta_r=theta_r, dphi=dphi)


def brdf(geometry: Geometry) -> FloatArray:
    return MODELS[SAMPLE.model].brdf(geometry, **SAMPLE.parameters)


def test_natural_light_and_an_indifferent_camera_change_nothing() -> None:
    geometry, angles = at(60.0, -50.0, 30.0)
    assert polarised(brdf, SAMPLE, angles, lamp=0.0, camera=0.0) is brdf
    assert facet_factor(geometry, angles, 0.0, 0.0) == pytest.approx(1.0)
    assert body_factor(geometry, 0.0, 0.0) == pytest.approx(1.0)


def test_at_brewster_s_angle_facets_reflect_horizontal_light_only() -> None:
    """Then they show both shares in full: (1 + lamp)(1 + camera)."""
    geometry, angles = at(BREWSTER_DEG, -BREWSTER_DEG, 0.0)
    assert facet_factor(geometry, angles, 0.05, 0.02) == pytest.approx(1.05 * 1.02)
    geometry, angles = at(BREWSTER_DEG, BREWSTER_DEG, 180.0)
    assert facet_factor(geometry, angles, -0.05, 0.0) == pytest.approx(0.95)


@given(theta_i=st.floats(0, 85), theta_r=st.floats(-85, 85), lamp=SHARES, camera=SHARES)
def test_opposite_polarisations_have_natural_light_as_their_mean(
    theta_i: float, theta_r: float, lamp: float, camera: float
) -> None:
    geometry, angles = at(theta_i, theta_r, 0.0)
    for one, other in ((lamp, 0.0), (0.0, camera)):
        factors = (facet_factor(geometry, angles, s * one, s * other) for s in (1, -1))
        assert sum(factors) == pytest.approx(2.0)


@given(
    theta_i=st.floats(0, 85), theta_r=st.floats(-85, 85), dphi=st.floats(0, 180), lamp=SHARES,
    camera=SHARES,
)  # fmt: skip
def test_lamp_and_camera_may_change_places(
    theta_i: float, theta_r: float, dphi: float, lamp: float, camera: float
) -> None:
    there = facet_factor(*at(theta_i, theta_r, dphi), lamp, camera)
    swapped = at(abs(theta_r), np.copysign(theta_i, theta_r), dphi)
    assert facet_factor(*swapped, camera, lamp) == pytest.approx(there, abs=1e-9)
    assert body_factor(swapped[0], camera, lamp) == pytest.approx(
        body_factor(at(theta_i, theta_r, dphi)[0], lamp, camera)
    )


def test_parts_of_a_lamp_at_the_normal_are_polarised_as_the_lamp_is() -> None:
    """Its parts lie at all azimuths about the normal; the light's direction is that of the axis."""
    angles = SeenAngles(theta_i=0.0, theta_r=40.0, dphi=0.0)
    parts = Geometry.from_degrees(theta_i=0.5, theta_r=40.0, dphi=np.arange(0.0, 360.0, 15.0))
    assert np.ptp(facet_factor(parts, angles, 0.1, 0.0)) < 0.002
    lamp, camera = (facet_factor(parts, angles, *shares) for shares in ((0.1, 0.0), (0.0, 0.1)))
    assert np.allclose(lamp, camera, atol=0.002)


def test_the_cost_is_that_of_the_computed_one() -> None:
    """Lamp 5 %, camera 2 %: below 1 % of a body seen at 84 deg, 1 to 5 % of the mirror's lobe."""
    geometry, angles = at(30.0, 84.0, 180.0)
    assert 0.001 < abs(body_factor(geometry, 0.0, 0.02)[0] - 1) < 0.01
    for theta in (30.0, 45.0, 60.0):
        geometry, angles = at(theta, -theta, 0.0)
        assert 0.015 < facet_factor(geometry, angles, 0.05, 0.0)[0] - 1 < 0.05
        found = polarised(brdf, SAMPLE, angles, lamp=0.05, camera=0.02)(geometry)
        assert 1.0 < found[0] / brdf(geometry)[0] < 1.07
