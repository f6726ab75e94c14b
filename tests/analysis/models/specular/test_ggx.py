"""GGX, EON and Minnaert: formulas typed from their sources, limits, and energy."""

from __future__ import annotations

import math
from collections.abc import Callable

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.models import MODELS
from analysis.models.eon import directional_albedo
from instrument.geometry import FloatArray, Geometry

ANGLE = st.floats(0.0, 89.0)
AZIMUTH = st.floats(0.0, 360.0)
PART = st.floats(0.0, 1.0)

_T, _W = np.polynomial.legendre.leggauss(120)
THETA, WEIGHT = np.pi / 4 * (_T + 1), np.pi / 4 * _W


def reflected(name: str, theta_i: float, azimuths: int = 720, **parameters: float) -> float:
    """Hemispherical reflectance: Gauss-Legendre in theta, half-step trapezoid in azimuth."""
    dphi = (np.arange(azimuths) + 0.5) * 180 / azimuths
    geometry = Geometry.from_degrees(
        theta_i=theta_i, theta_r=np.degrees(THETA)[:, np.newaxis], dphi=dphi
    )
    mean = MODELS[name].brdf(geometry, **parameters).mean(axis=1)
    return float(2 * np.pi * mean @ (WEIGHT * np.sin(THETA) * np.cos(THETA)))


def vectors(i: float, r: float, p: float) -> tuple[FloatArray, FloatArray]:
    lamp = np.array([math.sin(i), 0, math.cos(i)])
    return lamp, np.array([math.sin(r) * math.cos(p), math.sin(r) * math.sin(p), math.cos(r)])


@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, f0=PART, alpha=st.floats(0.02, 1.0))
def test_ggx_by_vectors(
    theta_i: float, theta_r: float, dphi: float, f0: float, alpha: float
) -> None:
    # Walter et al. 2007 (20), (33) for D; Heitz 2014 (72), (99) for Lambda and G2 by height
    lamp, camera = vectors(*map(math.radians, (theta_i, theta_r, dphi)))
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
def test_ggx_keeps_its_digits_at_grazing_and_for_a_narrow_lobe(
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


def test_ggx_s_narrow_lobe_is_a_mirror() -> None:
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
            lamp, _ = vectors(math.radians(theta_i), 0, 0)
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
def test_ggx_s_masking_leaves_the_projected_area(theta_r: float, alpha: float) -> None:
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
def test_ggx_reflects_less_than_it_receives(theta_i: float, alpha: float) -> None:
    assert 0.3 < reflected("ggx", theta_i, f0=1.0, alpha=alpha) <= 1.0 + 1e-3


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
def test_eon_as_published(
    theta_i: float, theta_r: float, dphi: float, rho: float, rough: float
) -> None:
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    found = MODELS["eon"].brdf(geometry, albedo=rho, roughness=rough)
    expected = printed_eon(*map(math.radians, (theta_i, theta_r, dphi)), rho, rough)
    assert found == pytest.approx(expected, rel=1e-10, abs=1e-13)


def halves(function: Callable[[FloatArray], FloatArray], kink: float) -> float:
    """Integral over theta of 0 to pi/2, with a panel's end at the kink."""
    total = 0.0
    for a, b in ((0.0, kink), (kink, np.pi / 2)):
        theta = a + (b - a) * (_T + 1) / 2
        total += float((b - a) / 2 * _W @ function(theta))
    return total


@pytest.mark.parametrize("roughness", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("theta_i", [0.0, 30.0, 60.0, 85.0, 90.0])
def test_a_white_eon_surface_reflects_all_light(theta_i: float, roughness: float) -> None:
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


def test_eon_s_directional_albedo_is_the_integral_of_its_single_scattering() -> None:
    # f_ss = f in the limit of a small albedo, per albedo
    for theta_i in (0.0, 40.0, 80.0):
        single = reflected("eon", theta_i, albedo=1e-9, roughness=0.8) * 1e9
        assert directional_albedo(np.radians(theta_i), 0.8) == pytest.approx(single, rel=1e-3)
    assert directional_albedo(np.array(np.pi / 2), 1.0) == pytest.approx(1, abs=1e-14)


@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, rho=PART)
def test_eon_without_roughness_is_lambert_s(
    theta_i: float, theta_r: float, dphi: float, rho: float
) -> None:
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    found = MODELS["eon"].brdf(geometry, albedo=rho, roughness=0.0)
    assert found == pytest.approx(rho / math.pi, rel=1e-14)


@given(theta_i=ANGLE, theta_r=ANGLE, rho=PART, k=st.floats(0.0, 2.0))
def test_minnaert_as_printed(theta_i: float, theta_r: float, rho: float, k: float) -> None:
    i, r = math.radians(theta_i), math.radians(theta_r)
    expected = rho * (k + 1) / (2 * math.pi) * (math.cos(i) * math.cos(r)) ** (k - 1)
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=77)
    assert MODELS["minnaert"].brdf(geometry, albedo=rho, k=k) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("k", [0.3, 1.0, 1.7])
@pytest.mark.parametrize("theta_i", [0.0, 50.0, 80.0])
def test_minnaert_reflects_its_albedo_times_a_power(theta_i: float, k: float) -> None:
    expected = 0.6 * math.cos(math.radians(theta_i)) ** (k - 1)
    assert reflected("minnaert", theta_i, 1, albedo=0.6, k=k) == pytest.approx(expected, rel=1e-4)


def test_where_minnaert_holds() -> None:
    model, geometry = MODELS["minnaert"], Geometry.from_degrees(theta_i=0, theta_r=[0, 59, 61, 90])
    # albedo 0.5, k = 0: as much leaves as comes where cos(theta) = 0.5
    dark = model.validity(geometry, albedo=0.5, k=0.0)
    assert list(dark.mask) == [True, True, False, False]
    assert "oblique" in dark.reason
    beyond = model.validity(geometry, albedo=0.5, k=1.2)
    assert not beyond.mask.any()
    assert "0 to 1" in beyond.reason
    lambert = model.validity(geometry, albedo=1.0, k=1.0)
    assert lambert.mask.all()
    assert lambert.reason == ""


@pytest.mark.parametrize("name", ["ggx", "eon"])
def test_the_lobes_hold_but_where_lamp_and_camera_both_graze(name: str) -> None:
    model = MODELS[name]
    geometry = Geometry.from_degrees(theta_i=90, theta_r=[0, 89.9, 90])
    found = model.validity(geometry, **{p.name: p.default for p in model.parameters})
    assert list(found.mask) == [True, True, False]
    assert "graze" in found.reason
