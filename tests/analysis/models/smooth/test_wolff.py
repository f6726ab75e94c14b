"""Wolff's model: against adaptive quadrature, its energy, reciprocity and limits."""

from __future__ import annotations

import math
import warnings
from functools import cache

import numpy as np
import pytest
from scipy.integrate import IntegrationWarning, quad

from analysis.models import MODELS
from analysis.models.smooth import internal_return
from analysis.models.smooth.chandrasekhar import (
    h_exact,
)
from analysis.models.smooth.fresnel import unpolarised, wolff_polynomial
from analysis.models.smooth.wolff import wolff_brdf
from instrument.geometry import FloatArray, Geometry
from tests.support.models.derivatives import central_difference
from tests.support.models.geometries import (
    random_directions,
)


@cache
def h_by_quad(mu: float, rho: float) -> float:
    """The exact integral by adaptive quadrature in t (ours: a trapezoidal rule in its logistic)."""

    def f(t: float) -> float:
        # 1 - t cot t, near 0 by its series
        rise = t * t / 3 + t**4 / 45 + 2 * t**6 / 945 if t < 0.01 else 1 - t / math.tan(t)
        return math.log(1 - rho + rho * rise) / (math.cos(t) ** 2 + (mu * math.sin(t)) ** 2)

    integral = quad(f, 0, math.pi / 2, epsabs=1e-11, epsrel=1e-11, limit=200)[0]
    return math.exp(-mu / math.pi * integral)


def wolff_as_printed(i_deg: float, r_deg: float, rho: float, n: float) -> float:
    """1998 (7) and (8) with the errata, K by adaptive quadrature over phi' on both sides of the
    critical angle, F by the amplitudes with the index 1/n, H by adaptive quadrature."""
    i, r = math.radians(i_deg), math.radians(r_deg)
    m_i, m_r = math.sqrt(1 - (math.sin(i) / n) ** 2), math.sqrt(1 - (math.sin(r) / n) ** 2)
    h_i, h_r = h_by_quad(m_i, rho), h_by_quad(m_r, rho)

    def f(phi: float) -> float:
        x = math.cos(phi)
        C = rho / (4 * math.pi) * x / (x + m_r) * h_by_quad(x, rho) * h_r
        return float(unpolarised(phi, 1 / n)) * C * 2 * math.pi * math.sin(phi)

    critical = math.asin(1 / n)
    K = sum(
        quad(f, a, b, epsabs=1e-9, epsrel=1e-9, limit=100)[0]
        for a, b in ((0, critical - 0.05), (critical - 0.05, critical), (critical, math.pi / 2))
    )
    varrho = rho / (4 * math.pi * n * n) * h_i * h_r / (m_i + m_r) / (1 - K)
    out = unpolarised(math.asin(math.sin(r) / n), 1 / n)
    return float(varrho * (1 - unpolarised(i, n)) * (1 - out))


@pytest.mark.parametrize(("rho", "n"), [(0.5, 1.5), (0.95, 1.33), (1.0, 1.5), (1.0, 2.0)])
def test_the_printed_formula_to_1e_7(rho: float, n: float) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IntegrationWarning)  # its target is tighter than needed
        for i, r in ((0.0, 0.0), (30.0, 70.0)):
            geometry = Geometry.from_degrees(theta_i=i, theta_r=r)
            found = MODELS["wolff"].brdf(geometry, single_scattering_albedo=rho, n=n)
            assert found == pytest.approx(wolff_as_printed(i, r, rho, n), rel=1e-7)


@pytest.mark.parametrize("n", [1.0, 1 + 1e-9, 1.01, 1.2, 1.5, 3.0])
@pytest.mark.parametrize("rho", [0.0, 0.6, 1.0])
def test_the_series_in_ln_mu_is_as_good_as_the_integrals(rho: float, n: float) -> None:
    theta = np.array([0.0, 10, 40, 70, 85, 89.9])
    mu = np.sqrt(1 - (np.sin(np.radians(theta)) / n) ** 2)
    K, H = internal_return.internal_return(mu, rho, n), h_exact(mu, rho)
    geometry = Geometry.from_degrees(theta_i=theta, theta_r=theta)
    found = MODELS["wolff"].brdf(geometry, single_scattering_albedo=rho, n=n)
    T = 1 - unpolarised(np.radians(theta), n)
    expected = rho / (4 * np.pi * n * n) * H * H / (2 * mu) / (1 - K) * T * T
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize("n", [1.0001, 1.2, 1.5, 2.9])
@pytest.mark.parametrize("rho", [0.3, 0.95, 1.0])
def test_the_derivative_by_the_index(rho: float, n: float) -> None:
    geometry = Geometry.from_degrees(
        theta_i=np.array([0.0, 20, 50, 80, 89])[:, np.newaxis], theta_r=[0.0, 35, 60, 85, 89.5]
    )
    expected = central_difference(
        lambda x: MODELS["wolff"].brdf(geometry, single_scattering_albedo=rho, n=x),
        n, 2e-3 * (n - 1),
    )  # fmt: skip
    found = MODELS["wolff"].gradient(geometry, single_scattering_albedo=rho, n=n)["n"]
    np.testing.assert_allclose(found, expected, rtol=2e-6, atol=1e-7)


def test_the_derivative_by_the_albedo_near_1() -> None:
    # It grows as 1/sqrt(1 - rho), so that the base class's step is too long there.
    geometry, rho = random_directions(20), 1 - 1e-5
    expected = central_difference(
        lambda r: MODELS["wolff"].brdf(geometry, single_scattering_albedo=r, n=1.5), rho, 1e-8
    )
    found = MODELS["wolff"].gradient(geometry, single_scattering_albedo=rho, n=1.5)
    np.testing.assert_allclose(found["single_scattering_albedo"], expected, rtol=1e-5)


@pytest.mark.parametrize("epsilon", [0.0, 0.07, 0.2])
def test_equation_7_with_the_polynomial(epsilon: float) -> None:
    # F of theta_i and of theta_r: the way out transmits as the way in
    geometry = Geometry.from_degrees(theta_i=[0.0, 50, 70, 90], theta_r=[0.0, 50, 70, 30], dphi=90)
    share = np.ones(4)
    for theta in (geometry.theta_i, geometry.theta_r):
        F = ((2 * theta / np.pi) ** 5 + epsilon) / (1 + epsilon)
        np.testing.assert_allclose(wolff_polynomial(theta, epsilon), F, rtol=1e-13)
        share = share * (1 - F)
    bare = wolff_brdf(geometry, 0.9, 1.5) / (
        (1 - unpolarised(geometry.theta_i, 1.5)) * (1 - unpolarised(geometry.theta_r, 1.5)) + 1e-300
    )
    found = wolff_brdf(geometry, 0.9, 1.5, epsilon)
    np.testing.assert_allclose(found[:3], (bare * share)[:3], rtol=1e-12)
    assert found[3] == pytest.approx(0, abs=1e-15)
    if epsilon == 0.07:  # as `wolff_brdf` states
        darker = found[:3] / wolff_brdf(geometry, 0.9, 1.5)[:3]
        np.testing.assert_allclose(darker, [0.95, 0.88, 0.65], atol=5e-3)


def reflected(theta_i: FloatArray, rho: float, n: float) -> FloatArray:
    """Hemispherical reflectance of `wolff` for each angle of incidence in degrees."""
    t, w = np.polynomial.legendre.leggauss(80)
    theta, weight = np.pi / 4 * (t + 1), np.pi / 4 * w
    geometry = Geometry.from_degrees(theta_i=theta_i[:, np.newaxis], theta_r=np.degrees(theta))
    brdf = MODELS["wolff"].brdf(geometry, single_scattering_albedo=rho, n=n)
    return np.asarray(2 * np.pi * brdf @ (weight * np.sin(theta) * np.cos(theta)))


@pytest.mark.parametrize("rho", [0.3, 0.9, 1.0])
def test_without_an_interface_it_is_the_half_space_of_chandrasekhar(rho: float) -> None:
    # exact: of the light from mu_0 the half-space returns 1 - H(mu_0) sqrt(1 - rho)
    theta = np.array([0.0, 30, 60, 80])
    expected = 1 - h_exact(np.cos(np.radians(theta)), rho) * math.sqrt(1 - rho)
    np.testing.assert_allclose(reflected(theta, rho, 1.0), expected, rtol=2e-6)


def test_energy_is_conserved_to_about_one_percent() -> None:
    # Stated in `wolff_brdf`: a consequence of K's dependence on theta_r alone.
    theta = np.linspace(0, 89, 30)
    total = reflected(theta, 1.0, 1.5) + unpolarised(np.radians(theta), 1.5)
    assert total.max() == pytest.approx(1.0096, abs=2e-4)
    assert np.all(reflected(theta, 1.0, 1.5) < 1)


@pytest.mark.parametrize(
    ("rho", "n", "difference"),
    [(0.5, 1.5, 0.015), (0.9, 1.5, 0.043), (0.98, 1.5, 0.051), (1.0, 1.5, 0.024),
     (0.97, 1.2, 0.056), (0.98, 2.0, 0.037), (0.9, 1.0, 0.0)],
)  # fmt: skip
def test_deviation_from_reciprocity_is_as_documented(
    rho: float, n: float, difference: float
) -> None:
    theta = np.linspace(0, 89.99, 61)
    geometry = Geometry.from_degrees(theta_i=theta[:, np.newaxis], theta_r=theta)
    brdf = MODELS["wolff"].brdf(geometry, single_scattering_albedo=rho, n=n)
    assert np.max(brdf / brdf.T - 1) == pytest.approx(difference, abs=6e-4)


def test_no_scattering_reflects_nothing() -> None:
    geometry = Geometry.from_degrees(theta_i=[0, 50, 90], theta_r=[90, 10, 90])
    assert np.all(MODELS["wolff"].brdf(geometry, single_scattering_albedo=0.0, n=1.5) == 0)


def test_validity_ends_where_a_bare_half_space_diverges() -> None:
    model, geometry = MODELS["wolff"], Geometry.from_degrees(theta_i=90, theta_r=[89, 90])
    bare = model.validity(geometry, single_scattering_albedo=0.9, n=1.0)
    assert list(bare.mask) == [True, False]
    assert "n = 1" in bare.reason
    assert model.validity(geometry, single_scattering_albedo=0.9, n=1.5).mask.all()


def test_it_has_a_value_at_every_index() -> None:
    # One n in 150 has sqrt(n^2)/n above 1 by rounding, which cannot be a cosine.
    mirror = Geometry.from_degrees(theta_i=0, theta_r=0)
    upper = np.array([(n - 1) * (n + 1) + 1 for n in np.linspace(1, 3, 4001)])
    index = np.linspace(1, 3, 4001)[np.sqrt(upper) / np.linspace(1, 3, 4001) > 1]
    assert index.size > 10
    for n in index[::5]:
        assert MODELS["wolff"].brdf(mirror, single_scattering_albedo=0.5, n=float(n)) > 0


@pytest.mark.parametrize("size", [20, 500])  # K by its integral, and by a series
def test_what_a_value_needs_inside_serves_its_derivatives(size: int) -> None:
    """F and H at the nodes of K's integral are most of the cost of either."""
    geometry = Geometry.from_degrees(theta_i=30.0, theta_r=np.linspace(-75, 75, size))
    inside, h_inside = internal_return._inside, internal_return._h_inside
    for kept in (inside, h_inside, internal_return._series, internal_return._gradient_series):
        kept.cache_clear()
    for number, n in enumerate((1.3, 1.4), 1):
        MODELS["wolff"].brdf(geometry, single_scattering_albedo=0.8, n=n)
        MODELS["wolff"].gradient(geometry, single_scattering_albedo=0.8, n=n)
        assert inside.cache_info().misses == number
        assert h_inside.cache_info().misses == number
