"""GGX: formulas typed from their sources, limits, and energy."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.models import MODELS
from instrument.geometry import FloatArray, Geometry
from tests.support.models.geometries import (
    unit_vectors,
)
from tests.support.models.reflectance import hemispherical_reflectance

ANGLE = st.floats(0.0, 89.0)
AZIMUTH = st.floats(0.0, 360.0)
PART = st.floats(0.0, 1.0)
GGX, GGX_F90 = MODELS["ggx"], MODELS["ggx_f90"]

_T, _W = np.polynomial.legendre.leggauss(120)
THETA, WEIGHT = np.pi / 4 * (_T + 1), np.pi / 4 * _W


@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, f0=PART, alpha=st.floats(0.02, 1.0))
def test_the_formula_by_vectors(
    theta_i: float, theta_r: float, dphi: float, f0: float, alpha: float
) -> None:
    # Walter et al. 2007 (20), (33) for D; Heitz 2014 (72), (99) for Lambda and G2 by height
    lamp, camera = unit_vectors(*map(math.radians, (theta_i, theta_r, dphi)))
    half = (lamp + camera) / np.linalg.norm(lamp + camera)

    def Lambda(v: FloatArray) -> float:  # noqa: N802 - the source's symbol
        tan2 = (1 - v[2] ** 2) / v[2] ** 2
        return float((math.sqrt(1 + alpha**2 * tan2) - 1) / 2)

    cos2 = half[2] ** 2
    D = 1 / (math.pi * alpha**2 * cos2**2 * (1 + (1 - cos2) / cos2 / alpha**2) ** 2)
    F = f0 + (1 - f0) * (1 - min(1.0, half @ lamp)) ** 5
    G2 = 1 / (1 + Lambda(lamp) + Lambda(camera))
    expected = F * D * G2 / (4 * lamp[2] * camera[2])
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    found = MODELS["ggx"].brdf(geometry, f0=f0, alpha=alpha)
    assert found == pytest.approx(expected, rel=1e-7, abs=1e-12)


@pytest.mark.parametrize(
    ("theta_i", "theta_r", "dphi"),
    [(89.99, 89.99, 180), (89.99, 89.98, 179.99), (60, 60.01, 180), (0, 0, 0), (89.9999, 1, 90),
     (45, 45, 180), (89.9, 89.9, 0), (1e-7, 1e-7, 180)],
)  # fmt: skip
@pytest.mark.parametrize("alpha", [0.001, 0.1, 1.0])
def test_full_precision_at_grazing_and_for_a_narrow_lobe(
    theta_i: float, theta_r: float, dphi: float, alpha: float
) -> None:
    with mp.workdps(50):
        i, r, p = (mp.mpf(x) * mp.pi / 180 for x in (theta_i, theta_r, dphi))
        a, f0 = mp.mpf(alpha), mp.mpf("0.04")
        across2 = mp.sin(i) ** 2 + mp.sin(r) ** 2 + 2 * mp.sin(i) * mp.sin(r) * mp.cos(p)
        along2 = (mp.cos(i) + mp.cos(r)) ** 2
        length2 = across2 + along2
        D = a**2 / mp.pi / (a**2 * along2 / length2 + across2 / length2) ** 2
        F = f0 + (1 - f0) * (1 - mp.sqrt(length2) / 2) ** 5
        q_i, q_r = (mp.sqrt(mp.cos(t) ** 2 + (a * mp.sin(t)) ** 2) for t in (i, r))
        expected = float(F * D / 2 / (mp.cos(i) * q_r + mp.cos(r) * q_i))
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    found = MODELS["ggx"].brdf(geometry, f0=0.04, alpha=alpha)
    assert found == pytest.approx(expected, rel=1e-9)


def test_a_narrow_lobe_is_a_mirror() -> None:
    for theta_i in (0.0, 30.0, 60.0):
        # Integrated over the half-vector: dense about the mirror direction.
        tan = 0.002 * np.tan(np.pi / 2 * (_T + 1) / 2)
        offset = np.degrees(np.arctan(tan))
        found = []
        for azimuth in (np.arange(180) + 0.5) * 2 * np.pi / 180:
            n = np.stack(
                [np.sin(np.radians(offset)) * np.cos(azimuth),
                 np.sin(np.radians(offset)) * np.sin(azimuth), np.cos(np.radians(offset))], axis=-1
            )  # fmt: skip
            lamp, _ = unit_vectors(math.radians(theta_i), 0, 0)
            dot = n @ lamp
            camera = 2 * dot[:, np.newaxis] * n - lamp
            up = (camera[:, 2] > 0) & (dot > 0)
            brdf = MODELS["ggx"].brdf(
                Geometry.from_directions(lamp, camera[up]), f0=1.0, alpha=0.002
            )
            jacobian = 4 * dot[up] * np.sin(np.radians(offset[up]))
            d_offset = (np.pi / 4 * _W * 0.002 / np.cos(np.pi / 4 * (_T + 1)) ** 2)[up]
            d_offset = d_offset / (1 + tan[up] ** 2)
            found.append(np.sum(brdf * camera[up, 2] * jacobian * d_offset))
        # All of the light, less the lobe's far tails (a part of the order of alpha).
        assert 2 * np.pi * np.mean(found) == pytest.approx(1, abs=0.005)


@pytest.mark.parametrize("alpha", [0.2, 0.6, 1.0])
@pytest.mark.parametrize("theta_r", [0.0, 40.0, 80.0])
def test_masking_leaves_the_projected_area(theta_r: float, alpha: float) -> None:
    # Heitz 2014 (14): int G1(v) <v h> D(h) dh = cos(theta_v). With the lamp at the zenith
    # G2 = G1(v), so that 4 f/(F D) = G1(v)/cos_v.
    geometry = Geometry.from_degrees(theta_i=0, theta_r=theta_r)
    at_half = math.radians(theta_r / 2)
    D = alpha**2 / (math.pi * (alpha**2 * math.cos(at_half) ** 2 + math.sin(at_half) ** 2) ** 2)
    G1 = 4 * math.cos(math.radians(theta_r)) * MODELS["ggx"].brdf(geometry, f0=1, alpha=alpha) / D
    r = math.radians(theta_r)
    azimuth = (np.arange(2000) + 0.5) * np.pi / 2000
    cos_half = np.cos(THETA)[:, np.newaxis] * math.cos(r)
    cos_half = cos_half + np.sin(THETA)[:, np.newaxis] * math.sin(r) * np.cos(azimuth)
    density = alpha**2 / (np.pi * (alpha**2 * np.cos(THETA) ** 2 + np.sin(THETA) ** 2) ** 2)
    seen = 2 * np.pi * np.maximum(cos_half, 0).mean(axis=1) @ (WEIGHT * np.sin(THETA) * density)
    assert G1 * seen == pytest.approx(math.cos(r), rel=2e-4)


@pytest.mark.parametrize("alpha", [0.05, 0.3, 1.0])
@pytest.mark.parametrize("theta_i", [0.0, 45.0, 75.0, 85.0])
def test_it_reflects_less_than_it_receives(theta_i: float, alpha: float) -> None:
    found = hemispherical_reflectance("ggx", theta_i, azimuths=720, f0=1.0, alpha=alpha)
    assert 0.3 < found <= 1.0 + 1e-3


def test_validity_ends_where_lamp_and_camera_both_graze() -> None:
    geometry = Geometry.from_degrees(theta_i=90, theta_r=[0, 89.9, 90])
    model = MODELS["ggx"]
    found = model.validity(geometry, **{p.name: p.default for p in model.parameters})
    assert list(found.mask) == [True, True, False]
    assert "graze" in found.reason


def test_f90_validity_ends_at_strength_1_and_at_grazing() -> None:
    geometry = Geometry.from_degrees(theta_i=[30.0, 90.0], theta_r=[30.0, 90.0])
    assert GGX_F90.validity(geometry, f0=1.0, f90=1.0, alpha=0.3).mask.tolist() == [True, False]
    strong = GGX_F90.validity(geometry, f0=0.1, f90=2.0, alpha=0.3)
    assert not strong.mask.any()
    assert "strength above 1" in strong.reason


@given(theta_i=ANGLE, theta_r=ANGLE, dphi=st.floats(0, 360), f0=st.floats(0, 1))
def test_f90_of_1_is_ggx(theta_i: float, theta_r: float, dphi: float, f0: float) -> None:
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    found = GGX_F90.brdf(geometry, f0=f0, f90=1.0, alpha=0.3)
    assert found == pytest.approx(float(GGX.brdf(geometry, f0=f0, alpha=0.3)), rel=1e-12)


def test_f0_and_f90_are_the_strengths_at_the_two_ends() -> None:
    """theta' = 0 looking along the lamp's ray; theta' near 90 degrees from grazing to grazing."""
    facing = Geometry.from_degrees(theta_i=20.0, theta_r=20.0, dphi=0.0)
    across = Geometry.from_degrees(theta_i=89.9999, theta_r=89.9999, dphi=180.0)
    for geometry, f0, f90 in ((facing, 0.3, 0.0), (across, 0.0, 0.3)):
        found = GGX_F90.brdf(geometry, f0=f0, f90=f90, alpha=0.4)
        whole = GGX_F90.brdf(geometry, f0=1.0, f90=1.0, alpha=0.4)
        assert found / whole == pytest.approx(0.3, rel=1e-4)
