"""Reflectance models: the printed formulas, their limits and what every BRDF must obey."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from analysis.models import MODELS, Model, Parameter
from analysis.models.base import add
from analysis.models.specular.torrance_sparrow import (
    gaussian_normalisation,
    half_vector,
    slope_density,
)
from instrument.geometry import FloatArray, Geometry

ANGLE = st.floats(0.0, 88.0)
AZIMUTH = st.floats(0.0, 360.0)
PART = st.floats(0.0, 1.0)
NAMES = [*MODELS, "oren_nayar+torrance_sparrow"]


def inside(model: Model, part: float) -> dict[str, float]:
    """Parameters at that part of their domain (of ks only the first tenth is physical)."""
    return {
        p.name: p.low + part * (p.high - p.low) * (0.1 if p.name == "ks" else 1.0)
        for p in model.parameters
    }


# Wolff's is not: 1998 (8) has the view angle in K; how far off it is, its own tests say.
@pytest.mark.parametrize("name", [n for n in NAMES if n != "wolff"])
@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, part=PART)
def test_reciprocal(name: str, theta_i: float, theta_r: float, dphi: float, part: float) -> None:
    model = MODELS[name]
    there = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    back = Geometry.from_degrees(theta_i=theta_r, theta_r=theta_i, dphi=-dphi)
    values = inside(model, part)
    np.testing.assert_allclose(
        model.brdf(there, **values), model.brdf(back, **values), rtol=1e-9, atol=1e-12
    )


@pytest.mark.parametrize("name", ["lambert", "oren_nayar_qualitative", "torrance_sparrow"])
@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, part=PART)
def test_never_negative_where_promised(
    name: str, theta_i: float, theta_r: float, dphi: float, part: float
) -> None:
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    assert MODELS[name].brdf(geometry, **inside(MODELS[name], part)) >= 0


def test_the_functional_model_is_negative_far_forward_as_printed() -> None:
    # errata: at sigma 60 degrees the direct term (33) is negative from 77/77 degrees on
    geometry = Geometry.from_degrees(theta_i=80, theta_r=80, dphi=180)
    assert MODELS["oren_nayar"].brdf(geometry, albedo=0.1, sigma_deg=60) < 0


@pytest.mark.parametrize("name", ["oren_nayar", "oren_nayar_qualitative"])
@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, albedo=PART)
def test_a_smooth_surface_is_lambert_s(
    name: str, theta_i: float, theta_r: float, dphi: float, albedo: float
) -> None:
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    found = MODELS[name].brdf(geometry, albedo=albedo, sigma_deg=0.0)
    np.testing.assert_allclose(found, MODELS["lambert"].brdf(geometry, albedo=albedo), rtol=1e-14)


def printed_functional(i: float, r: float, dphi: float, rho: float, sigma: float) -> float:
    """1995 (33) + (34) over E0 cos(theta_i), typed from the paper; angles in radians."""
    a, b, c, s2 = max(i, r), min(i, r), math.cos(dphi), sigma**2
    c1 = 1 - 0.5 * s2 / (s2 + 0.33)
    c2 = 0.45 * s2 / (s2 + 0.09) * (math.sin(a) - (0 if c >= 0 else (2 * b / math.pi) ** 3))
    c3 = 0.125 * (s2 / (s2 + 0.09)) * (4 * a * b / math.pi**2) ** 2
    l1 = rho / math.pi * (c1 + c * c2 * math.tan(b) + (1 - abs(c)) * c3 * math.tan((a + b) / 2))
    l2 = 0.17 * rho**2 / math.pi * s2 / (s2 + 0.13) * (1 - c * (2 * b / math.pi) ** 2)
    return l1 + l2


def printed_qualitative(i: float, r: float, dphi: float, rho: float, sigma: float) -> float:
    """1995 (36) over E0 cos(theta_i), typed from the paper; angles in radians."""
    s2 = sigma**2
    big_a, big_b = 1.0 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)
    lobe = max(0.0, math.cos(dphi)) * math.sin(max(i, r)) * math.tan(min(i, r))
    return rho / math.pi * (big_a + big_b * lobe)


@pytest.mark.parametrize(
    ("name", "printed"),
    [("oren_nayar", printed_functional), ("oren_nayar_qualitative", printed_qualitative)],
)
@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, albedo=PART, sigma=st.floats(0.0, 60.0))
def test_the_printed_formula(
    name: str, printed: object, theta_i: float, theta_r: float, dphi: float, albedo: float,
    sigma: float,
) -> None:  # fmt: skip
    assert callable(printed)
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    expected = printed(*map(math.radians, (theta_i, theta_r, dphi)), albedo, math.radians(sigma))
    found = MODELS[name].brdf(geometry, albedo=albedo, sigma_deg=sigma)
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_the_qualitative_model_forward_as_in_the_errata() -> None:
    # errata: sigma 30 degrees, 75/60 opposite sides: 0.773 per albedo / pi
    geometry = Geometry.from_degrees(theta_i=75, theta_r=60, dphi=180)
    found = MODELS["oren_nayar_qualitative"].brdf(geometry, albedo=1, sigma_deg=30) * np.pi
    assert found == pytest.approx(0.773, abs=5e-4)


@pytest.mark.parametrize("sigma_deg", [0.5, 2.0, 10.0, 30.0, 60.0, 70.0])
def test_the_slope_density_integrates_to_one(sigma_deg: float) -> None:
    sigma = math.radians(sigma_deg)
    end = min(math.pi / 2, 12 * sigma)
    integral = quad(
        lambda t: 2 * math.pi * math.exp(-(t**2) / (2 * sigma**2)) * math.sin(t),
        0, end, epsabs=0, epsrel=1e-12,
    )[0]  # fmt: skip
    assert gaussian_normalisation(sigma) * integral == pytest.approx(1, rel=1e-10)


@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, sigma=st.floats(1.0, 60.0))
def test_torrance_sparrow_by_vectors(
    theta_i: float, theta_r: float, dphi: float, sigma: float
) -> None:
    i, r, p = map(math.radians, (theta_i, theta_r, dphi))
    lamp = np.array([math.sin(i), 0, math.cos(i)])
    camera = np.array([math.sin(r) * math.cos(p), math.sin(r) * math.sin(p), math.cos(r)])
    half = (lamp + camera) / np.linalg.norm(lamp + camera)
    cos_a, cos_half = float(half[2]), float(half @ lamp)
    G = min(1, 2 * cos_a * math.cos(r) / cos_half, 2 * cos_a * math.cos(i) / cos_half)
    P = float(slope_density(np.array(math.acos(min(1.0, cos_a))), math.radians(sigma)))
    expected = 0.3 * G * P / (4 * math.cos(i) * math.cos(r) * cos_a)
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    found = MODELS["torrance_sparrow"].brdf(geometry, ks=0.3, sigma_deg=sigma)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-300)


def test_the_half_vector_s_limits() -> None:
    geometry = Geometry.from_degrees(
        theta_i=[40, 40, 0, 90], theta_r=[40, 40, 50, 90], dphi=[180, 0, 0, 180]
    )
    theta_a, cos_a, cos_half = half_vector(geometry)
    # Mirror direction: along the normal; back to the lamp: along the lamp; from the zenith: half.
    np.testing.assert_allclose(np.degrees(theta_a[:3]), [0, 40, 25], atol=1e-6)
    np.testing.assert_allclose(cos_half[:3], np.cos(np.radians([40, 0, 25])), rtol=1e-12)
    np.testing.assert_allclose(cos_a[:3], np.cos(theta_a[:3]), rtol=1e-12)
    assert cos_half[3] < 1e-10


def hemisphere(brdf: FloatArray, theta: FloatArray, weight: FloatArray) -> float:
    return float(2 * np.pi * np.mean(brdf, axis=1) @ (weight * np.sin(theta) * np.cos(theta)))


def test_lambert_reflects_its_albedo_and_a_mirror_lobe_its_ks() -> None:
    t, w = np.polynomial.legendre.leggauss(200)
    theta, weight = np.pi / 4 * (t + 1), np.pi / 4 * w
    geometry = Geometry.from_degrees(
        theta_i=0, theta_r=np.degrees(theta)[:, np.newaxis], dphi=np.arange(0, 360, 10.0)
    )
    found = hemisphere(MODELS["lambert"].brdf(geometry, albedo=0.7), theta, weight)
    assert found == pytest.approx(0.7, rel=1e-12)
    # At normal incidence every facet of a narrow lobe is lit and seen: all of ks comes back,
    # less the facets' foreshortening (mean cos theta_a, at 3 degrees 1 - 0.003).
    lobe = hemisphere(MODELS["torrance_sparrow"].brdf(geometry, ks=0.2, sigma_deg=3), theta, weight)
    assert lobe == pytest.approx(0.2, rel=0.01)


@pytest.mark.parametrize("name", NAMES)
def test_broadcast_shapes(name: str) -> None:
    model = MODELS[name]
    values = {p.name: p.default for p in model.parameters}
    grid = Geometry.from_degrees(theta_i=[[10.0], [50.0]], theta_r=[-60.0, 0.0, 60.0], dphi=30.0)
    found = model.brdf(grid, **values)
    assert found.shape == (2, 3)
    assert found.dtype == np.float64
    one = model.brdf(Geometry.from_degrees(theta_i=50, theta_r=-60, dphi=30), **values)
    assert one.shape == ()
    assert one == pytest.approx(found[1, 0], rel=1e-15)


@pytest.mark.parametrize("name", NAMES)
def test_grazing_directions_give_numbers(name: str) -> None:
    geometry = Geometry.from_degrees(
        theta_i=[[0.0], [45.0], [90.0]], theta_r=[-90.0, -45.0, 0.0, 45.0, 90.0]
    )
    values = {p.name: p.default for p in MODELS[name].parameters}
    with np.errstate(all="raise"):
        assert np.all(np.isfinite(MODELS[name].brdf(geometry, **values)))


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"albedo": 0.5}, "sigma_deg"),
        ({"albedo": 0.5, "sigma_deg": 61}, "61 degrees; allowed: 0 to 60 degrees"),
        ({"albedo": -0.1, "sigma_deg": 20}, r"albedo = -0.1; allowed: 0 to 1"),
        ({"albedo": math.nan, "sigma_deg": 20}, "albedo = nan"),
        ({"albedo": 0.5, "sigma_deg": math.inf}, "sigma_deg = inf"),
        ({"albedo": 0.5, "sigma_deg": 20, "ks": 0.1}, "no parameter ks"),
    ],
)
def test_wrong_parameters_are_named(values: dict[str, float], words: str) -> None:
    geometry = Geometry.from_degrees(theta_i=0, theta_r=0)
    with pytest.raises(ValueError, match=words):
        MODELS["oren_nayar"].brdf(geometry, **values)


def test_a_sum_shares_sigma_with_the_narrower_domain() -> None:
    model = MODELS["oren_nayar+torrance_sparrow"]
    assert [(p.name, p.low, p.high) for p in model.parameters] == [
        ("albedo", 0, 1), ("sigma_deg", 0.5, 60), ("ks", 0, 10)
    ]  # fmt: skip
    geometry = Geometry.from_degrees(theta_i=30, theta_r=[-50, 20])
    parts = MODELS["oren_nayar"].brdf(geometry, albedo=0.8, sigma_deg=20)
    parts = parts + MODELS["torrance_sparrow"].brdf(geometry, ks=0.1, sigma_deg=20)
    found = model.brdf(geometry, albedo=0.8, sigma_deg=20, ks=0.1)
    np.testing.assert_allclose(found, parts, rtol=1e-15)


def test_parameters_that_cannot_be_shared() -> None:
    def model(low: float, high: float, unit: str) -> Model:
        width = Parameter("width", unit, low, high, low)
        return Model("m", (width,), MODELS["lambert"].kernel)

    for other in (model(3, 4, "degrees"), model(0, 1, "radians")):
        with pytest.raises(ValueError, match="width cannot be shared"):
            add(model(0, 1, "degrees"), other)


@pytest.mark.parametrize("name", ["phong", "lambert+phong", "lambert+lambert", ""])
def test_unknown_names_list_the_known(name: str) -> None:
    with pytest.raises(KeyError, match=r"oren_nayar_qualitative|each model once in a sum"):
        MODELS[name]
    assert name not in MODELS


def test_the_mapping_lists_the_single_models() -> None:
    assert {"lambert", "oren_nayar", "oren_nayar_qualitative", "torrance_sparrow"} <= set(MODELS)
    assert all(MODELS[name].name == name for name in MODELS)
    assert len(MODELS) == len(list(MODELS))
