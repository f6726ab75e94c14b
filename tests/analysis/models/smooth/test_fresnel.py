"""Fresnel reflectance against the printed equations in 40 digits, and its limits."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest

from analysis.models.smooth.fresnel import (
    amplitudes,
    polarised,
    reflectances,
    transmittance,
    transmittance_with_gradients,
    unpolarised,
    wolff_polynomial,
)

DEGREES = [0.0, 1e-6, 0.01, 10, 30, 45, 56.31, 60, 75, 89, 89.9, 89.9999, 90.0]
DIELECTRICS = [1 + 1e-12, 1 + 1e-6, 1.01, 1.33, 1.5, 2.0, 2.4, 10.0]
# Aluminium, gold, silver, iron in visible light, and a nearly clear absorber; n - ik.
METALS = [0.96 - 6.69j, 0.27 - 2.78j, 0.14 - 3.98j, 2.88 - 3.08j, 1.5 - 1e-6j]


def printed(theta: float, index: complex, h: float) -> float:
    """1991, equations (12), (13), (41)-(43), as printed, in 40 digits."""
    with mp.workdps(40):
        Y, t = mp.mpmathify(index), mp.mpf(theta)
        c, q = mp.cos(t), mp.sqrt(Y**2 - mp.sin(t) ** 2)
        para = (Y**2 * c - q) / (Y**2 * c + q)
        perp = (c - q) / (c + q)
        return float(h * abs(para) ** 2 + (1 - h) * abs(perp) ** 2)


@pytest.mark.parametrize("index", [*DIELECTRICS, *METALS, 0.2, 1 / 1.5, 0.999])
@pytest.mark.parametrize("h", [0.0, 0.5, 1.0])
def test_the_printed_equations_to_1e_12(index: complex, h: float) -> None:
    theta = np.radians(DEGREES)
    expected = [printed(t, index, h) for t in theta]
    np.testing.assert_allclose(polarised(theta, index, h), expected, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("index", [1.01, 1.5, 10.0, *METALS])
def test_the_amplitudes_as_printed(index: complex) -> None:
    theta = np.radians(DEGREES)
    for t, para, perp in zip(theta, *amplitudes(theta, index), strict=True):
        with mp.workdps(40):
            Y2, c = mp.mpmathify(index) ** 2, mp.cos(mp.mpf(float(t)))
            q = mp.sqrt(Y2 - 1 + c**2)
            expected = complex((Y2 * c - q) / (Y2 * c + q)), complex((c - q) / (c + q))
        assert (para, perp) == pytest.approx(expected, rel=1e-12, abs=1e-13)


def test_a_real_index_has_the_phases_of_a_weak_absorber() -> None:
    # n - ik with k -> 0, also in total reflection, where the amplitudes are complex
    theta = np.radians([10.0, 60.0, 85.0])
    both = amplitudes(theta, 1 / 1.5), amplitudes(theta, 1 / 1.5 - 1e-14j)
    for real, absorbing in zip(*both, strict=True):
        np.testing.assert_allclose(real, absorbing, rtol=1e-12)
        assert np.all(np.abs(real.imag[1:]) > 0.1)


@pytest.mark.parametrize("n", [1.33, 1.5, 2.0])
def test_equation_2_of_1998_where_it_is_defined(n: float) -> None:
    for degrees in [d for d in DEGREES if 0.01 < d < 89.9]:
        t = math.radians(degrees)
        with mp.workdps(40):
            i = mp.mpf(t)
            r = mp.asin(mp.sin(i) / mp.mpf(n))
            bracket = 1 + (mp.cos(i + r) / mp.cos(i - r)) ** 2
            expected = float((mp.sin(i - r) / mp.sin(i + r)) ** 2 * bracket / 2)
        assert unpolarised(t, n) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("n", [1.0, 1.5, 2.0, 1.5 - 3j])
def test_normal_incidence(n: complex) -> None:
    # errata: (2) is 0/0 there; ((n - 1)/(n + 1))^2
    para, perp = reflectances(0.0, n)
    expected = abs((n - 1) / (n + 1)) ** 2
    assert para == pytest.approx(expected, rel=1e-14)
    assert perp == pytest.approx(expected, rel=1e-14)


def test_no_interface_reflects_nothing_even_at_grazing() -> None:
    theta = np.radians(DEGREES)
    assert np.all(unpolarised(theta, 1.0) == 0)
    np.testing.assert_allclose(transmittance(theta, 1.0), 1.0, rtol=1e-15)


@pytest.mark.parametrize("n", [1.01, 1.5, 3.0])
def test_grazing_reflects_all(n: float) -> None:
    assert unpolarised(np.pi / 2, n) == pytest.approx(1, abs=1e-14)
    # 1 - F in full relative precision, where 1 - unpolarised has no digit left
    with mp.workdps(40):
        c = mp.cos(mp.mpf(math.radians(89.9999999)))
        q = mp.sqrt(mp.mpf(n) ** 2 - 1 + c**2)
        n2 = mp.mpf(n) ** 2
        expected = float(2 * c * q * (1 / (c + q) ** 2 + n2 / (n2 * c + q) ** 2))
    assert transmittance(math.radians(89.9999999), n) == pytest.approx(expected, rel=1e-12)


def test_total_internal_reflection_is_exactly_1() -> None:
    critical = math.asin(1 / 1.5)
    beyond = np.linspace(critical + 1e-9, np.pi / 2, 50)
    for part in (*reflectances(beyond, 1 / 1.5), unpolarised(beyond, 1 / 1.5)):
        assert np.all(part == 1.0)
    assert unpolarised(critical - 1e-3, 1 / 1.5) < 0.9


@pytest.mark.parametrize("n", [0.2, 1 / 1.5, 1 - 1e-9])
def test_near_the_critical_angle_the_error_is_that_of_the_angle(n: float) -> None:
    # F starts as a square root: near it, the last digit of theta matters more than ours do.
    for off in (0.0, 1e-15, 1e-12, 1e-9, 1e-7):
        t = math.asin(n) * (1 - off)
        either = [printed(x, n, 0.5) for x in (math.nextafter(t, 0), t, math.nextafter(t, 2))]
        allowed = 4 * max(abs(e - either[1]) for e in either) + 1e-12
        assert unpolarised(t, n) == pytest.approx(either[1], rel=0, abs=allowed)


def test_one_polarisation_passes_completely_at_brewsters_angle() -> None:
    para, perp = reflectances(np.arctan(1.5), 1.5)
    assert para < 1e-30
    assert perp == pytest.approx(((1 - 1.5**2) / (1 + 1.5**2)) ** 2, rel=1e-14)


@pytest.mark.parametrize("n", [1.05, 1.5, 2.5])
def test_the_way_out_transmits_as_the_way_in(n: float) -> None:
    # both factors of 1998 (7): F(asin(sin(theta)/n), 1/n) = F(theta, n)
    theta = np.radians(np.linspace(0, 89, 90))
    inside = np.arcsin(np.sin(theta) / n)
    np.testing.assert_allclose(1 - unpolarised(inside, 1 / n), transmittance(theta, n), atol=3e-14)
    np.testing.assert_allclose(1 - unpolarised(theta, n), transmittance(theta, n), atol=1e-15)


def test_the_sign_of_k_does_not_matter() -> None:
    theta = np.radians(DEGREES)
    both = unpolarised(theta, 0.27 - 2.78j), unpolarised(theta, 0.27 + 2.78j)
    np.testing.assert_allclose(*both, rtol=1e-15)


@pytest.mark.parametrize("n", [1.001, 1.3, 1.5, 3.0])
def test_the_derivative_by_n(n: float) -> None:
    for t in np.radians([0.0, 20, 60, 80, 89]):

        def transmitted(m: mp.mpf, t: float = t) -> mp.mpf:
            c = mp.cos(mp.mpf(float(t)))
            q = mp.sqrt(m**2 - 1 + c**2)
            return 2 * c * q * (1 / (c + q) ** 2 + m**2 / (m**2 * c + q) ** 2)

        with mp.workdps(40):
            expected = float(mp.diff(transmitted, mp.mpf(n)))
        value, found, _ = transmittance_with_gradients(np.cos(t), n)
        assert value == pytest.approx(float(transmittance(t, n)), rel=1e-14)
        assert found == pytest.approx(expected, rel=1e-10, abs=1e-13)


@pytest.mark.parametrize("n", [1.0, 1.001, 1.5, 3.0])
def test_the_derivative_by_the_cosine(n: float) -> None:
    for t in np.radians([0.0, 20, 60, 80, 89]):

        def transmitted(c: mp.mpf) -> mp.mpf:
            n2 = mp.mpf(n) ** 2
            q = mp.sqrt(n2 - 1 + c**2)
            return 2 * c * q * (1 / (c + q) ** 2 + n2 / (n2 * c + q) ** 2)

        with mp.workdps(40):
            expected = float(mp.diff(transmitted, mp.cos(mp.mpf(float(t)))))
        *_, found = transmittance_with_gradients(np.cos(t), n)
        assert found == pytest.approx(expected, rel=1e-10, abs=1e-13)


def test_the_polynomial_of_wolff_has_the_stated_error() -> None:
    theta = np.radians(np.linspace(0, 90, 9001))
    error = wolff_polynomial(theta) - unpolarised(theta, 1.5)
    assert error[0] == pytest.approx(0.0254, abs=1e-4)
    assert error.max() == pytest.approx(0.197, abs=1e-3)
    assert np.degrees(theta[error.argmax()]) == pytest.approx(79, abs=0.2)
    assert wolff_polynomial(np.pi / 2) == pytest.approx(1)


def test_shapes_broadcast() -> None:
    found = polarised(np.zeros((3, 1)), np.array([1.5, 2.0]), 0.5)
    assert found.shape == (3, 2)
    assert found.dtype == np.float64


def test_wrong_input_is_named() -> None:
    with pytest.raises(ValueError, match=r"h = 1\.5; allowed: 0 to 1"):
        polarised(0.0, 1.5, 1.5)
    with pytest.raises(ValueError, match="index = "):
        unpolarised(0.0, -1.0)
    with pytest.raises(ValueError, match=r"n = 0\.5; allowed: 1 or more"):
        transmittance(0.0, 0.5)
    with pytest.raises(ValueError, match=r"epsilon = -1; allowed: 0 or more"):
        wolff_polynomial(0.0, -1.0)
    for function in (lambda t: unpolarised(t, 1.5), lambda t: transmittance(t, 1.5)):
        for wrong in (-0.1, 1.6, math.nan):
            with pytest.raises(ValueError, match=f"theta = {wrong} radians; allowed: 0 to pi/2"):
                function([0.3, wrong])
