"""Torrance and Sparrow's lobe: its own width, any facets, any Fresnel factor, its limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from analysis.models import MODELS
from analysis.models.smooth.fresnel import polarised
from analysis.models.specular.torrance_sparrow import (
    attenuation,
    gaussian,
    gaussian_normalisation,
    half_vector,
    local_incidence,
    mean_square_slope,
    slope_density,
    torrance_sparrow_full,
)
from instrument.geometry import FloatArray, Geometry
from tests.support.models.derivatives import central_difference
from tests.support.models.geometries import (
    exchanged,
    unit_vectors,
)
from tests.support.models.reflectance import hemispherical_reflectance

ANGLE = st.floats(0.0, 89.0)

AZIMUTH = st.floats(0.0, 360.0)

SIGMA = st.floats(0.5, 60.0)

NAMES = {"torrance_sparrow": "sigma_deg", "torrance_sparrow_lobe": "lobe_sigma_deg"}

GRID = Geometry.from_degrees(
    theta_i=np.array([0.0, 10.0, 40.0, 70.0, 85.0])[:, None, None],
    theta_r=np.array([0.0, 5.0, 40.0, 69.0, 88.0])[:, None],
    dphi=[0.0, 45.0, 120.0, 180.0],
)


@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, sigma=SIGMA)
def test_both_models_are_the_same_lobe(
    theta_i: float, theta_r: float, dphi: float, sigma: float
) -> None:
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    own = MODELS["torrance_sparrow_lobe"].brdf(geometry, ks=0.3, lobe_sigma_deg=sigma)
    assert own == MODELS["torrance_sparrow"].brdf(geometry, ks=0.3, sigma_deg=sigma)


def test_a_sum_shares_no_width_with_it() -> None:
    model = MODELS["oren_nayar+torrance_sparrow_lobe"]
    assert [p.name for p in model.parameters] == ["albedo", "sigma_deg", "ks", "lobe_sigma_deg"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("sigma", [0.5, 2.0, 10.0, 30.0, 60.0])
def test_gradient_is_that_of_central_differences(name: str, sigma: float) -> None:
    width = NAMES[name]
    step = 1e-4 * sigma
    inner = min(max(sigma, 0.5 + 2 * step), 60 - 2 * step)
    found = MODELS[name].gradient(GRID, **{"ks": 0.7, width: inner})
    expected = central_difference(
        lambda x: MODELS[name].brdf(GRID, **{"ks": 0.7, width: x}), inner, step
    )
    scale = np.maximum(np.abs(expected), MODELS[name].brdf(GRID, **{"ks": 0.7, width: inner}))
    near = half_vector(GRID)[0] < 12 * math.radians(inner)  # beyond: below e^-72 of the peak
    assert np.all((np.abs(found[width] - expected) <= 1e-7 * scale) | ~near)
    unit = MODELS[name].brdf(GRID, **{"ks": 1.0, width: inner})
    np.testing.assert_allclose(found["ks"], unit, rtol=1e-14)


@pytest.mark.parametrize("sigma_deg", [0.5, 5.0, 25.0, 60.0])
def test_the_mean_square_slope_by_adaptive_quadrature(sigma_deg: float) -> None:
    sigma = math.radians(sigma_deg)

    def moment(power: int) -> float:
        return float(
            quad(
                lambda t: t**power * math.exp(-(t**2) / (2 * sigma**2)) * math.sin(t),
                0, min(math.pi / 2, 12 * sigma), epsabs=0, epsrel=1e-12,
            )[0]
        )  # fmt: skip

    assert mean_square_slope(sigma) == pytest.approx(moment(2) / moment(0), rel=1e-11)


@pytest.mark.parametrize("sigma_deg", [0.5, 2.0, 10.0, 30.0, 60.0, 70.0])
def test_the_slope_density_integrates_to_one(sigma_deg: float) -> None:
    sigma = math.radians(sigma_deg)
    end = min(math.pi / 2, 12 * sigma)
    integral = quad(
        lambda t: 2 * math.pi * math.exp(-(t**2) / (2 * sigma**2)) * math.sin(t),
        0, end, epsabs=0, epsrel=1e-12,
    )[0]  # fmt: skip
    assert gaussian_normalisation(sigma) * integral == pytest.approx(1, rel=1e-10)


@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, sigma=SIGMA)
def test_the_full_form_is_the_model_for_a_constant_fresnel_factor(
    theta_i: float, theta_r: float, dphi: float, sigma: float
) -> None:
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    expected = MODELS["torrance_sparrow"].brdf(geometry, ks=0.3, sigma_deg=sigma)
    for density in (sigma, gaussian(sigma)):
        found = torrance_sparrow_full(geometry, 0.3, density)
        assert found == pytest.approx(expected, rel=1e-14, abs=1e-300)


@given(theta_i=st.floats(0.1, 88.0), theta_r=st.floats(0.1, 88.0), dphi=AZIMUTH)
def test_local_incidence_and_attenuation_as_printed(
    theta_i: float, theta_r: float, dphi: float
) -> None:
    # 1991 (38) with cos(phi_r) = -cos(dphi), errata's form of (39), and (44)
    i, r, p = map(math.radians, (theta_i, theta_r, dphi))
    cos2 = math.cos(r) * math.cos(i) + math.sin(r) * math.sin(i) * math.cos(p)
    local = math.acos(max(-1.0, min(1.0, cos2))) / 2
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    assert local_incidence(geometry) == pytest.approx(local, abs=3e-8)  # the acos's own loss
    cos_a = (math.cos(i) + math.cos(r)) / (2 * math.cos(local))
    G = min(1, 2 * cos_a * min(math.cos(i), math.cos(r)) / math.cos(local))
    assert attenuation(geometry) == pytest.approx(G, rel=1e-6)
    assert 0 <= attenuation(geometry) <= 1


def test_local_incidence_at_its_ends() -> None:
    geometry = Geometry.from_degrees(
        theta_i=[40, 40, 90, 1e-7], theta_r=[40, 40, 90, 0], dphi=[0, 180, 180, 0]
    )
    np.testing.assert_allclose(np.degrees(local_incidence(geometry)), [0, 40, 90, 5e-8], rtol=1e-9)


@pytest.mark.parametrize("index", [1.5, 0.2 - 3.0j])
@pytest.mark.parametrize("h", [0.0, 0.5, 1.0])
def test_fresnel_by_a_function_or_by_an_array(index: complex, h: float) -> None:
    by_function = torrance_sparrow_full(GRID, lambda t: polarised(t, index, h), 15.0)
    by_array = torrance_sparrow_full(GRID, polarised(local_incidence(GRID), index, h), 15.0)
    np.testing.assert_array_equal(by_function, by_array)
    one = torrance_sparrow_full(GRID, 1.0, 15.0)
    assert np.all((by_function >= 0) & (by_function <= one))


def test_polarisations_add_up_and_separate_at_brewsters_angle() -> None:
    def lobe(h: float) -> FloatArray:
        return torrance_sparrow_full(brewster, lambda t: polarised(t, 1.5, h), 10.0)

    angle = math.degrees(math.atan(1.5))
    brewster = Geometry.from_degrees(theta_i=angle, theta_r=angle, dphi=180)
    assert lobe(1.0) < 1e-20 * lobe(0.0)
    assert lobe(0.5) == pytest.approx(lobe(0.0) / 2, rel=1e-12)


def test_any_density_of_facets() -> None:
    """Mirrors of Beckmann's density, whose lobe at normal incidence reflects by its cosine."""
    m2 = math.tan(math.radians(12)) ** 2

    def facets(theta: FloatArray) -> FloatArray:  # per facet area: density times the cosine
        return np.exp(-np.square(np.tan(theta)) / m2) / (math.pi * m2 * np.cos(theta) ** 3)

    theta_a, cos_a, _ = half_vector(GRID)
    cc = np.cos(GRID.theta_i) * np.cos(GRID.theta_r)
    with np.errstate(under="ignore"):
        expected = attenuation(GRID) * facets(theta_a) / (4 * cc * cos_a)
        found = torrance_sparrow_full(GRID, 1.0, facets)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-300)


@pytest.mark.parametrize("sigma", [5.0, 20.0, 40.0, 60.0])
@pytest.mark.parametrize("theta_i", [0.0, 45.0, 75.0, 88.0])
def test_no_more_than_ks_is_reflected(sigma: float, theta_i: float) -> None:
    found = hemispherical_reflectance("torrance_sparrow", theta_i, ks=1.0, sigma_deg=sigma)
    assert 0.3 < found <= 1 + 1e-6


def test_a_narrow_lobe_is_a_mirror() -> None:
    # sigma -> 0: all of ks near the mirror direction, and almost nothing elsewhere
    found = hemispherical_reflectance("torrance_sparrow_lobe", 30, ks=1.0, lobe_sigma_deg=2)
    assert found == pytest.approx(1, abs=2e-3)
    off = Geometry.from_degrees(theta_i=30, theta_r=[-20, -40, 30], dphi=0)
    assert np.all(MODELS["torrance_sparrow_lobe"].brdf(off, ks=1.0, lobe_sigma_deg=0.5) < 1e-16)


@pytest.mark.parametrize("name", NAMES)
@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, sigma=SIGMA)
def test_reciprocal_and_not_negative(
    name: str, theta_i: float, theta_r: float, dphi: float, sigma: float
) -> None:
    there = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    back = exchanged(there, same_dphi=True)
    f = MODELS[name].brdf(there, **{"ks": 1.0, NAMES[name]: sigma})
    assert f >= 0
    again = MODELS[name].brdf(back, **{"ks": 1.0, NAMES[name]: sigma})
    assert again == pytest.approx(f, rel=1e-11, abs=1e-200)


@pytest.mark.parametrize("name", NAMES)
def test_the_closed_domain_and_both_sides_of_validity(name: str) -> None:
    ends = np.array([0.0, 45.0, 89.999, 90.0])
    geometry = Geometry.from_degrees(
        theta_i=ends[:, None, None], theta_r=ends[:, None], dphi=[0.0, 90.0, 180.0]
    )
    for sigma in (0.5, 20.0, 60.0):
        values = {"ks": 1.0, NAMES[name]: sigma}
        f = MODELS[name].brdf(geometry, **values)
        gradient = MODELS[name].gradient(geometry, **values)
        assert np.all(np.isfinite(f) & (f >= 0))
        assert all(np.all(np.isfinite(s)) for s in gradient.values())
        valid = MODELS[name].validity(geometry, **values)
        assert "graze" in valid.reason
        assert not np.any(valid.mask[3, 3])
        assert np.sum(~valid.mask) == 3
        # the largest is P(0) / 4 cos^2 at 89.999 degrees
        assert np.max(f[valid.mask]) < 1e13


def test_shapes_and_type() -> None:
    for name, width in NAMES.items():
        values = {"ks": 1.0, width: 20.0}
        assert MODELS[name].brdf(GRID, **values).dtype == np.float64
        gradient = MODELS[name].gradient(GRID, **values)
        assert all(s.shape == GRID.shape and s.dtype == np.float64 for s in gradient.values())
        assert MODELS[name].validity(GRID, **values).mask.shape == GRID.shape


def test_the_half_vector_keeps_its_digits_near_the_mirror_direction() -> None:
    # theta_a is half the angle between theta_r and the mirror direction, in the plane of incidence
    off = np.array([1e-3, 1e-6, 1e-9])
    geometry = Geometry.from_degrees(theta_i=45.0, theta_r=-45.0 - off)
    exact = np.radians(geometry.theta_r_deg - 45.0) / 2
    np.testing.assert_allclose(half_vector(geometry)[0], exact, rtol=1e-5)
    side = Geometry.from_degrees(theta_i=45.0, theta_r=45.0, dphi=180 - off)
    sine = math.sin(math.pi / 4) * np.sin(np.radians(180 - side.dphi_deg) / 2)
    np.testing.assert_allclose(
        half_vector(side)[0], np.arctan2(sine, math.cos(math.pi / 4)), rtol=1e-5
    )


def test_a_wrong_width_is_named() -> None:
    with pytest.raises(ValueError, match=r"sigma_deg = 0\.001 degrees; allowed: 0\.01 to 60"):
        gaussian(0.001)
    assert gaussian(20.0)(np.array(0.1)) == slope_density(np.array(0.1), math.radians(20))


@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, sigma=st.floats(1.0, 60.0))
def test_the_formula_by_vectors(theta_i: float, theta_r: float, dphi: float, sigma: float) -> None:
    i, r, p = map(math.radians, (theta_i, theta_r, dphi))
    lamp, camera = unit_vectors(i, r, p)
    half = (lamp + camera) / np.linalg.norm(lamp + camera)
    cos_a, cos_half = float(half[2]), float(half @ lamp)
    G = min(1, 2 * cos_a * math.cos(r) / cos_half, 2 * cos_a * math.cos(i) / cos_half)
    P = float(slope_density(np.array(math.acos(min(1.0, cos_a))), math.radians(sigma)))
    expected = 0.3 * G * P / (4 * math.cos(i) * math.cos(r) * cos_a)
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    found = MODELS["torrance_sparrow"].brdf(geometry, ks=0.3, sigma_deg=sigma)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-300)


def test_limits_of_the_half_vector() -> None:
    geometry = Geometry.from_degrees(
        theta_i=[40, 40, 0, 90], theta_r=[40, 40, 50, 90], dphi=[180, 0, 0, 180]
    )
    theta_a, cos_a, cos_half = half_vector(geometry)
    # Mirror direction: along the normal; back to the lamp: along the lamp; from the zenith: half.
    np.testing.assert_allclose(np.degrees(theta_a[:3]), [0, 40, 25], atol=1e-6)
    np.testing.assert_allclose(cos_half[:3], np.cos(np.radians([40, 0, 25])), rtol=1e-12)
    np.testing.assert_allclose(cos_a[:3], np.cos(theta_a[:3]), rtol=1e-12)
    assert cos_half[3] < 1e-10


def test_a_narrow_lobe_at_normal_incidence_reflects_ks() -> None:
    # Every facet is lit and seen: ks less the facets' foreshortening (mean cos(theta_a), at
    # 3 degrees 1 - 0.003).
    found = hemispherical_reflectance("torrance_sparrow", 0.0, ks=0.2, sigma_deg=3.0)
    assert found == pytest.approx(0.2, rel=0.01)


@pytest.mark.parametrize(
    ("sigma", "theta_i"), np.random.default_rng(13).uniform((-2, 0), (-0.3, 70), (12, 2)).tolist()
)
def test_lobes_narrower_than_a_fit_has_are_right(sigma: float, theta_i: float) -> None:
    """Down to the 0.01 degrees of 1991, figure 13: the shape in the plane, and all of the light.

    A narrow lobe is a mirror: it reflects the Fresnel factor, here 1, but for terms of sigma^2.
    """
    sigma = 10**sigma
    off = np.linspace(-8, 8, 161) * sigma
    mirror = Geometry.from_degrees(theta_i=theta_i, theta_r=-(theta_i + 2 * off), dphi=0.0)
    found = torrance_sparrow_full(mirror, 1.0, sigma)
    shape = np.exp(-0.5 * (off / sigma) ** 2)
    i, r = math.radians(theta_i), np.radians(theta_i + 2 * off)
    expected = gaussian_normalisation(math.radians(sigma)) * shape / (4 * math.cos(i) * np.cos(r))
    np.testing.assert_allclose(found, expected / np.cos(np.radians(off)), rtol=1e-8)
    # In the half-vector's coordinates dω_r = 4 cos(θ') dω_a, and here cos(θ') is about cos(θ_i).
    radial = np.linspace(0, 9, 4001) * math.radians(sigma)
    P = gaussian(sigma)(radial)
    assert np.trapezoid(P * 2 * np.pi * np.sin(radial), radial) == pytest.approx(1, rel=1e-5)
