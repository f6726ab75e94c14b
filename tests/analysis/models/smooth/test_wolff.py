"""Chandrasekhar's H, Wolff's model and its combination with Oren and Nayar's."""

from __future__ import annotations

import math
import warnings
from functools import cache

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import IntegrationWarning, quad

from analysis.models import MODELS
from analysis.models.smooth.chandrasekhar import (
    characteristic_roots,
    h_exact,
    h_order,
    log_h_gradient,
)
from analysis.models.smooth.fresnel import unpolarised, wolff_polynomial
from analysis.models.smooth.wolff import internal_return, wolff_brdf
from analysis.models.smooth.wolff_oren_nayar import (
    TRANSITION_DEG,
    roughness_share,
    wolff_oren_nayar_brdf,
)
from instrument.geometry import FloatArray, Geometry

ALBEDOS = [0.0, 0.3, 0.9, 0.9999, 1 - 1e-10, 1.0]


def h_by_mpmath(mu: float, rho: float) -> float:
    """The exact integral (errata), 25 digits, with panels that end where it changes quickly."""
    with mp.workdps(25):
        m, r = mp.mpf(mu), mp.mpf(rho)

        def f(t: mp.mpf) -> mp.mpf:
            with mp.workdps(70):  # 1 - t cot t loses twice the zeros of t
                inside = 1 - r * t * mp.cot(t)
            return mp.log(inside) / (mp.cos(t) ** 2 + (m * mp.sin(t)) ** 2)

        decades = [mp.mpf(10) ** -e for e in range(1, 11, 2)]
        ends = [0, *reversed(decades), mp.pi / 4, *(mp.pi / 2 - d for d in decades), mp.pi / 2]
        return float(mp.exp(-m / mp.pi * mp.quad(f, ends)))


@pytest.mark.parametrize("albedo", ALBEDOS)
@pytest.mark.parametrize("mu", [1e-7, 0.01, 0.5, 1.0])
def test_h_against_the_integral_in_25_digits(mu: float, albedo: float) -> None:
    assert h_exact(mu, albedo) == pytest.approx(h_by_mpmath(mu, albedo), rel=1e-12)


def test_h_as_chandrasekhar_has_it() -> None:
    # Radiative Transfer, table XI, as quoted in the errata
    np.testing.assert_allclose(h_exact([1.0, 0.5, 0.0], 1.0), [2.9078, 2.0128, 1.0], atol=5e-5)


@pytest.mark.parametrize("albedo", ALBEDOS)
def test_h_solves_its_nonlinear_equation(albedo: float) -> None:
    # H(mu) = 1 + (rho/2) mu H(mu) int_0^1 H(x)/(mu + x) dx, and the moment int_0^1 H dx
    t, w = np.polynomial.legendre.leggauss(40)
    x, w = ((t + 1) / 2) ** 4, w / 2 * 4 * ((t + 1) / 2) ** 3  # dense where H is steep
    H, mu = h_exact(x, albedo), np.array([0.05, 0.4, 1.0])
    integral = (H / (mu[:, np.newaxis] + x)) @ w
    expected = 1 + albedo / 2 * mu * h_exact(mu, albedo) * integral
    np.testing.assert_allclose(h_exact(mu, albedo), expected, rtol=1e-9)
    moment = 2 / albedo * (1 - math.sqrt(1 - albedo)) if albedo else 1.0
    assert H @ w == pytest.approx(moment, rel=1e-9)


@pytest.mark.parametrize(("order", "error"), [(7, 1e-2), (63, 1e-3)])
def test_the_order_needed_for_an_accuracy(order: int, error: float) -> None:
    # The table in analysis/models/chandrasekhar.py; 621 for 1e-4 would be slow here.
    mu = np.concatenate([np.geomspace(1e-6, 0.1, 200), np.linspace(0.1, 1, 50)])
    worst = {
        n: max(np.max(np.abs(h_order(mu, r, n) / h_exact(mu, r) - 1)) for r in (0.5, 0.9, 1.0))
        for n in (order, order - 1)
    }
    assert worst[order] <= error < worst[order - 1]


def test_the_error_of_the_order_falls_as_its_square_away_from_grazing() -> None:
    mu = np.linspace(0.745, 1, 20)  # the cosines inside for n = 1.5
    for order, error in ((3, 1e-2), (9, 1e-3), (27, 1e-4), (84, 1e-5)):
        assert np.max(np.abs(h_order(mu, 1.0, order) / h_exact(mu, 1.0) - 1)) <= error


@pytest.mark.parametrize("albedo", [0.0, 0.2, 0.9, 1 - 1e-12, 1.0])
@pytest.mark.parametrize("order", [1, 2, 8, 40])
def test_the_characteristic_roots(order: int, albedo: float) -> None:
    zeros, weights = np.polynomial.legendre.leggauss(2 * order)
    mu, a = zeros[order:], weights[order:]
    kappa = characteristic_roots(albedo, order)
    assert kappa.shape == (order,)
    if albedo == 0:  # H = 1: every factor of the one product cancels one of the other
        np.testing.assert_allclose(kappa, np.sort(1 / mu), rtol=1e-12)
        return
    products = kappa[:, np.newaxis] * mu
    residual = 1 - albedo * (a / ((1 - products) * (1 + products))).sum(axis=1)
    slope = albedo * (2 * products**2 * a / ((1 - products) * (1 + products)) ** 2).sum(axis=1)
    assert np.all(np.abs(residual) <= 1e-9 * np.maximum(slope, 1e-3))


def test_one_root_is_exactly_0_without_absorption() -> None:
    for order in (1, 2, 10, 100):
        kappa = characteristic_roots(1.0, order)
        assert kappa[0] == 0
        assert np.all(kappa[1:] > 1)
    # first order by hand: mu_1 = 1/sqrt(3), a_1 = 1, so H = 1 + sqrt(3) mu
    np.testing.assert_allclose(
        h_order([0.0, 0.5, 1.0], 1.0, 1), 1 + np.sqrt(3) * np.array([0, 0.5, 1])
    )


def test_the_slope_of_h() -> None:
    mu = np.array([0.001, 0.3, 1.0])
    for rho in (0.1, 0.9, 0.999):
        step = 1e-5 * (1 - rho)
        up, down = np.log(h_exact(mu, rho + step)), np.log(h_exact(mu, rho - step))
        np.testing.assert_allclose(log_h_gradient(mu, rho), (up - down) / (2 * step), rtol=1e-6)


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
def test_wolff_as_printed_to_1e_7(rho: float, n: float) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IntegrationWarning)  # it asks for more than is needed
        for i, r in ((0.0, 0.0), (30.0, 70.0)):
            geometry = Geometry.from_degrees(theta_i=i, theta_r=r)
            found = MODELS["wolff"].brdf(geometry, single_scattering_albedo=rho, n=n)
            assert found == pytest.approx(wolff_as_printed(i, r, rho, n), rel=1e-7)


@pytest.mark.parametrize("n", [1.0, 1 + 1e-9, 1.01, 1.2, 1.5, 3.0])
@pytest.mark.parametrize("rho", [0.0, 0.6, 1.0])
def test_the_series_in_ln_mu_is_as_good_as_the_integrals(rho: float, n: float) -> None:
    theta = np.array([0.0, 10, 40, 70, 85, 89.9])
    mu = np.sqrt(1 - (np.sin(np.radians(theta)) / n) ** 2)
    K, H = internal_return(mu, rho, n), h_exact(mu, rho)
    geometry = Geometry.from_degrees(theta_i=theta, theta_r=theta)
    found = MODELS["wolff"].brdf(geometry, single_scattering_albedo=rho, n=n)
    T = 1 - unpolarised(np.radians(theta), n)
    expected = rho / (4 * np.pi * n * n) * H * H / (2 * mu) / (1 - K) * T * T
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize("n", [1.0001, 1.2, 1.5, 2.9])
@pytest.mark.parametrize("rho", [0.3, 0.95, 1.0])
def test_the_slope_by_the_index(rho: float, n: float) -> None:
    geometry = Geometry.from_degrees(
        theta_i=np.array([0.0, 20, 50, 80, 89])[:, np.newaxis], theta_r=[0.0, 35, 60, 85, 89.5]
    )
    h = 2e-3 * (n - 1)
    f = [
        MODELS["wolff"].brdf(geometry, single_scattering_albedo=rho, n=n + k * h)
        for k in (-2, -1, 1, 2)
    ]
    expected = (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * h)
    found = MODELS["wolff"].gradient(geometry, single_scattering_albedo=rho, n=n)["n"]
    np.testing.assert_allclose(found, expected, rtol=2e-6, atol=1e-7)


@pytest.mark.parametrize("epsilon", [0.0, 0.07, 0.2])
def test_equation_7_and_9_with_the_polynomial(epsilon: float) -> None:
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
    smooth = wolff_oren_nayar_brdf(geometry, 0.6, 0.0, 1.5, epsilon)
    np.testing.assert_allclose(smooth, 0.6 / np.pi * share, rtol=1e-12, atol=1e-16)
    if epsilon == 0.07:  # as `wolff_brdf` says
        darker = found[:3] / wolff_brdf(geometry, 0.9, 1.5)[:3]
        np.testing.assert_allclose(darker, [0.95, 0.88, 0.65], atol=5e-3)


def test_wrong_cosines_and_albedos_are_named() -> None:
    for function in (lambda x: h_exact(x, 0.5), lambda x: h_order(x, 0.5, 3)):
        for wrong in (-0.1, 1.5, math.nan):
            with pytest.raises(ValueError, match=f"mu = {wrong}; allowed: 0 to 1"):
                function([0.3, wrong])
    with pytest.raises(ValueError, match=r"albedo = 1\.5; allowed: 0 to 1"):
        h_order(0.5, 1.5, 3)
    with pytest.raises(ValueError, match="order = 0; allowed: 1 or more"):
        h_order(0.5, 0.5, 0)


def reflected(theta_i: FloatArray, rho: float, n: float) -> FloatArray:
    """Hemispherical reflectance of `wolff` for each angle of incidence in degrees."""
    t, w = np.polynomial.legendre.leggauss(80)
    theta, weight = np.pi / 4 * (t + 1), np.pi / 4 * w
    geometry = Geometry.from_degrees(theta_i=theta_i[:, np.newaxis], theta_r=np.degrees(theta))
    brdf = MODELS["wolff"].brdf(geometry, single_scattering_albedo=rho, n=n)
    return np.asarray(2 * np.pi * brdf @ (weight * np.sin(theta) * np.cos(theta)))


@pytest.mark.parametrize("rho", [0.3, 0.9, 1.0])
def test_without_an_interface_it_is_chandrasekhar_s_half_space(rho: float) -> None:
    # exact: of the light from mu_0 the half-space returns 1 - H(mu_0) sqrt(1 - rho)
    theta = np.array([0.0, 30, 60, 80])
    expected = 1 - h_exact(np.cos(np.radians(theta)), rho) * math.sqrt(1 - rho)
    np.testing.assert_allclose(reflected(theta, rho, 1.0), expected, rtol=2e-6)


def test_energy_is_kept_to_about_one_percent() -> None:
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
def test_how_far_it_is_from_reciprocal(rho: float, n: float, difference: float) -> None:
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


def printed_combination(
    i: float, r: float, dphi: float, rho: float, s: float, n: float
) -> float:  # fmt: skip
    """1998 (3) with C1 of (9), without (4), typed from the paper; angles in radians."""
    a, b, c, s2 = max(i, r), min(i, r), math.cos(dphi), s * s
    c1 = 1 - 0.5 * s2 / (s2 + 0.33)
    c1 *= 1 - float(unpolarised(i, n))
    c1 *= 1 - float(unpolarised(math.asin(math.sin(r) / n), 1 / n))
    c2 = 0.45 * s2 / (s2 + 0.09) * (math.sin(a) - (0 if c >= 0 else (2 * b / math.pi) ** 3))
    c3 = 0.125 * s2 / (s2 + 0.09) * (4 * a * b / math.pi**2) ** 2
    bracket = c1 + c * c2 * math.tan(b) + (1 - abs(c)) * c3 * math.tan((a + b) / 2)
    return rho / math.pi * bracket


@pytest.mark.parametrize("dphi", [0.0, 70.0, 120.0, 180.0])
@pytest.mark.parametrize("sigma", [0.0, 5.0, 20.0, 50.0])
def test_the_combined_model_as_printed(sigma: float, dphi: float) -> None:
    for i, r in ((0.0, 0.0), (30.0, 60.0), (75.0, 40.0), (80.0, 80.0)):
        geometry = Geometry.from_degrees(theta_i=i, theta_r=r, dphi=dphi)
        found = MODELS["wolff_oren_nayar"].brdf(geometry, albedo=0.7, sigma_deg=sigma, n=1.6)
        expected = printed_combination(
            *map(math.radians, (i, r, dphi)), 0.7, math.radians(sigma), 1.6
        )
        assert found == pytest.approx(expected, rel=1e-11, abs=1e-13)


def test_the_combined_model_without_an_interface_is_the_functional_without_bounces() -> None:
    geometry = Geometry.from_degrees(theta_i=50, theta_r=[-70, 0, 70], dphi=20)
    found = MODELS["wolff_oren_nayar"].brdf(geometry, albedo=0.5, sigma_deg=20, n=1.0)
    dark = MODELS["oren_nayar"].brdf(geometry, albedo=1e-9, sigma_deg=20) * 0.5e9
    np.testing.assert_allclose(found, dark, rtol=1e-8)


@pytest.mark.parametrize(
    ("sigma_deg", "ratio"), [(2.5, 100), (6, 20), (9, 10), (17, 4), (22, 3), (36, 2)]
)
def test_the_transition_range_as_the_authors_read_it(sigma_deg: float, ratio: float) -> None:
    # 1998, section 4 and figure 16
    assert 1 / roughness_share(sigma_deg) == pytest.approx(ratio, rel=0.07)
    assert sigma_deg not in TRANSITION_DEG or ratio in (10, 2)


def test_where_the_combined_model_holds() -> None:
    model = MODELS["wolff_oren_nayar"]
    geometry = Geometry.from_degrees(theta_i=85, theta_r=[-85, 0, 85])
    inside = model.validity(geometry, albedo=0.5, sigma_deg=20, n=1.5)
    assert list(inside.mask) == [False, True, True]
    assert "negative" in inside.reason
    assert np.all((model.brdf(geometry, albedo=0.5, sigma_deg=20, n=1.5) >= 0) == inside.mask)
    above = model.validity(geometry, albedo=0.5, sigma_deg=37, n=1.5)
    assert not above.mask.any()
    assert "36 degrees" in above.reason
