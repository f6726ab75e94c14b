"""Chandrasekhar's H: against its integral in 25 digits, its equation, and its N-th order form."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest

from analysis.models.smooth.chandrasekhar import (
    HFunction,
    characteristic_roots,
    h_exact,
    h_order,
)
from tests.support.models.derivatives import central_difference

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


def test_h_as_tabulated_by_chandrasekhar() -> None:
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
    # The table in analysis/models/smooth/chandrasekhar.py; 621 for 1e-4 would be slow here.
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


def test_the_derivative_of_ln_h_by_the_albedo() -> None:
    mu = np.array([0.001, 0.3, 1.0])
    for rho in (0.1, 0.9, 0.999):
        expected = central_difference(lambda r: np.log(h_exact(mu, r)), rho, 1e-4 * (1 - rho))
        np.testing.assert_allclose(HFunction.at(mu).log_gradient(rho), expected, rtol=1e-6)


def test_wrong_cosines_and_albedos_are_named() -> None:
    for function in (lambda x: h_exact(x, 0.5), lambda x: h_order(x, 0.5, 3)):
        for wrong in (-0.1, 1.5, math.nan):
            with pytest.raises(ValueError, match=f"mu = {wrong}; allowed: 0 to 1"):
                function([0.3, wrong])
    with pytest.raises(ValueError, match=r"albedo = 1\.5; allowed: 0 to 1"):
        h_order(0.5, 1.5, 3)
    with pytest.raises(ValueError, match="order = 0; allowed: 1 or more"):
        h_order(0.5, 0.5, 0)
