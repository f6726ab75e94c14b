"""Beckmann and Spizzichino's lobe and spike, against sums of 40 digits and physical limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.models import MODELS
from analysis.models.specular import beckmann_spizzichino
from analysis.models.specular.beckmann_spizzichino import (
    geometric_factor,
    lobe_brdf,
    optical_roughness,
    rough_lobe_brdf,
    smooth_lobe_brdf,
    spike_brdf,
    wave_vector,
)
from analysis.models.specular.poisson_sums import (
    Terms,
    largest_term,
    poisson_sum,
    poisson_term,
    poisson_terms,
)
from analysis.models.specular.surface_statistics import slope_scale
from analysis.models.specular.torrance_sparrow import (
    half_vector,
    tangential_squared,
    torrance_sparrow_full,
)
from instrument.geometry import FloatArray, Geometry
from tests.support.models.derivatives import central_difference
from tests.support.models.geometries import (
    exchanged,
)
from tests.support.models.reflectance import hemispherical_reflectance

MODEL = MODELS["beckmann_spizzichino"]

WEIGHTS: dict[str, Callable[..., object]] = {  # for numbers of either kind
    "of the lobe": lambda m, *_: 1 / m,
    "of its derivative by ln g": lambda m, g, _: (m - g) / m,
    "of its derivative by ln T^2": lambda m, _, q: (1 - q / m) / m,
}

ROUGHNESSES = [1e-12, 1e-3, 1.0, 10.0, 39.0, 41.0, 70.0, 100.0, 1e4, 1e6]


def exact_sum(g: mp.mpf, q: mp.mpf) -> mp.mpf:
    return exact_sums(g, q, ["of the lobe"])[0]


def exact_sums(g: mp.mpf, q: mp.mpf, names: Sequence[str]) -> list[mp.mpf]:
    """e^-g sum g^m/(m!) w(m) e^(-q/m), outwards from the largest term to negligible ones."""

    def rises(m: int) -> bool:  # from term m to term m + 1
        return bool(mp.log(g / (m + 1)) + q / m - q / (m + 1) > 0)

    low, high = 0, 1
    while rises(high):
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if rises(middle) else (low, middle)
    peak = mp.exp(high * mp.log(g) - mp.loggamma(high + 1) - g)
    totals = [mp.mpf(0)] * len(names)
    for step in (1, -1):
        m, poisson, first = high, peak, peak * mp.exp(-q / high)
        while m >= 1:
            term = poisson * mp.exp(-q / m)
            if step == 1 or m < high:
                weights = [WEIGHTS[name](mp.mpf(m), g, q) for name in names]
                totals = [total + term * w for total, w in zip(totals, weights, strict=True)]
            if term < first * mp.mpf("1e-18"):
                break
            poisson = poisson * g / (m + 1) if step == 1 else poisson * m / g
            m += step
    return totals


@pytest.mark.slow
@pytest.mark.parametrize("g", ROUGHNESSES)
def test_the_sum_to_eleven_digits(g: float, slow: bool) -> None:
    """From the mirror direction (q = 0) to wings 1e-200 of the peak, and either side of m = 40."""
    base = max(g, 1.0)
    with mp.workdps(25):
        places = (0.0, 1e-9, 0.3 * base, 20 * base, 250 * base)
        # So many terms take seconds: without q = 0, which has its own test in closed form.
        for q in places if g < 1e5 else places[2::2] if slow else places[2:3]:
            expected = exact_sum(mp.mpf(g), mp.mpf(q))
            found = float(poisson_sum(np.array(g), np.array(q), WEIGHTS["of the lobe"]))
            assert found == pytest.approx(float(expected), rel=3e-11, abs=1e-290)


@pytest.mark.parametrize("g", [1e-3, 2.0, 25.0, 45.0, 300.0, 2e4])
def test_the_sums_of_the_gradient(g: float) -> None:
    for q in (0.0, 0.3 * g, 20 * g, 900.0):
        with mp.workdps(25):
            sums = [float(s) for s in exact_sums(mp.mpf(g), mp.mpf(q), list(WEIGHTS))]
        for (name, weight), expected in zip(WEIGHTS.items(), sums, strict=True):
            found = float(poisson_sum(np.array(g), np.array(q), weight))
            assert abs(found - expected) <= 1e-9 * max(abs(expected), sums[0]) + 1e-290, (name, q)


@settings(deadline=None)
@given(g=st.floats(1e-6, 300.0), q=st.floats(0.0, 3000.0))
def test_the_sum_at_random_arguments(g: float, q: float) -> None:
    with mp.workdps(25):
        expected = float(exact_sum(mp.mpf(g), mp.mpf(q)))
    found = float(poisson_sum(np.array(g), np.array(q), WEIGHTS["of the lobe"]))
    assert found == pytest.approx(expected, rel=1e-10, abs=1e-290)


@pytest.mark.parametrize("g", [1e-8, 0.5, 30.0, 50.0, 1e3, 1e6])
def test_the_mirror_direction_in_closed_form(g: float) -> None:
    # q = 0: e^-g (Ei(g) - gamma - ln g), a reference without a sum
    with mp.workdps(50):
        expected = float(mp.exp(-g) * (mp.ei(g) - mp.euler - mp.log(g)))
    found = float(poisson_sum(np.array(g), np.array(0.0), WEIGHTS["of the lobe"]))
    assert found == pytest.approx(expected, rel=1e-11)


def test_no_overflow_and_no_warning() -> None:
    g = np.array([0.0, 5e-324, 1e-12, 1.0, 39.9, 40.1, 70.0, 100.0, 1e4, 1e6, 1e8])[:, None]
    q = np.array([0.0, 1e-300, 1.0, 1e3, 1e6, 1e9, 1e12])
    for weight in WEIGHTS.values():
        with np.errstate(all="raise"):
            found = poisson_sum(g, q, weight)
        assert found.shape == (11, 7)
        assert np.all(np.isfinite(found))
        assert np.all(found[0] == 0)
    assert np.all(poisson_sum(g, q, WEIGHTS["of the lobe"]) >= 0)


def test_position_of_the_largest_term() -> None:
    g, q = np.array([1e-3, 2.0, 50.0, 1e6]), np.array([1e4, 3.0, 0.0, 1e9])
    m = largest_term(g, q)
    np.testing.assert_allclose(m * m * np.log(m / g), q, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("g", [60.0, 3e3, 1e6])
def test_a_poisson_term(g: float) -> None:
    m = g * np.array([0.9, 1.0, 1.1]) + 0.25
    with mp.workdps(40):
        expected = [float(mp.exp(x * mp.log(g) - mp.loggamma(mp.mpf(x) + 1) - g)) for x in m]
    np.testing.assert_allclose(poisson_term(m, np.array(g)), expected, rtol=1e-11)


def exact_lobe(i: float, r: float, dphi: float, sigma_h: float, length: float) -> float:
    """The formula in 40 digits, from the angles in degrees; (16) as in the errata."""
    with mp.workdps(40):
        i, r, dphi = (mp.radians(mp.mpf(a)) for a in (i, r, dphi))
        k, sigma_h, T = 2 * mp.pi, mp.mpf(sigma_h), mp.mpf(length)
        cos_phi, sin_phi = -mp.cos(dphi), -mp.sin(dphi)
        v_x = k * (mp.sin(i) - mp.sin(r) * cos_phi)
        v_y = k * mp.sin(r) * sin_phi
        g = (k * sigma_h * (mp.cos(i) + mp.cos(r))) ** 2
        D = 1 + mp.cos(i) * mp.cos(r) - mp.sin(i) * mp.sin(r) * cos_phi
        D = D / (mp.cos(i) * (mp.cos(i) + mp.cos(r)))
    with mp.workdps(25):
        total = exact_sum(g, (v_x**2 + v_y**2) * T**2 / 4)
        return float(mp.cos(i) / mp.cos(r) * mp.pi * T**2 * D**2 * total)


PLACES = [
    (30.0, 30.0 + 1e-9),
    (45.0, 45.0),
    (60.0, 60.001),
    (60.0, 59.0),
    (5.0, 11.0),
    (80.0, 89.9),
]


@pytest.mark.slow
@pytest.mark.parametrize(("sigma_h", "length"), [
    (1e-7, 5.0), (0.02, 3.0), (0.1, 1000.0), (0.4, 5.0), (0.7, 0.5), (5.0, 60.0), (79.6, 900.0),
])  # fmt: skip
def test_the_lobe_to_1e_9(sigma_h: float, length: float, slow: bool) -> None:
    """g up to 1e6 (sigma_h 79.6 at normal incidence), near the mirror direction and far off."""
    sides = [180.0, 180.0 - 1e-7, 175.0] if sigma_h < 5 else [179.9]
    roughest = [(0.0, 1e-3), (0.0, 1.0), (70.0, 71.0)]  # so many terms take seconds
    for i, r in PLACES if sigma_h < 70 else roughest if slow else roughest[1:2]:
        for dphi in sides:
            geometry = Geometry.from_degrees(theta_i=i, theta_r=r, dphi=dphi)
            found = MODEL.brdf(geometry, scale=1.0, sigma_h=sigma_h, correlation_length=length)
            expected = exact_lobe(i, r, float(geometry.dphi_deg), sigma_h, length)
            assert found == pytest.approx(expected, rel=1e-9, abs=1e-280), (i, r, dphi)


def test_the_far_wing_where_only_late_terms_do_not_underflow() -> None:
    geometry = Geometry.from_degrees(theta_i=20.0, theta_r=70.0, dphi=10.0)
    for sigma_h, length in ((0.15, 20.0), (0.3, 30.0), (1.0, 30.0)):
        found = MODEL.brdf(geometry, scale=1.0, sigma_h=sigma_h, correlation_length=length)
        expected = exact_lobe(20.0, 70.0, 10.0, sigma_h, length)
        assert 1e-280 < expected < 1e-40
        assert found == pytest.approx(expected, rel=1e-9)


@given(theta_i=st.floats(0, 89), theta_r=st.floats(0, 89), dphi=st.floats(0, 360))
def test_the_wave_vector_and_the_half_vector_agree(
    theta_i: float, theta_r: float, dphi: float
) -> None:
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    v_x, v_y, v_z = wave_vector(geometry)
    across2 = (2 * math.pi) ** 2 * tangential_squared(geometry)
    assert v_x**2 + v_y**2 == pytest.approx(across2, rel=1e-9, abs=1e-13)
    # (57): tan(alpha) = v_xy / v_z; D = cos(theta') / (cos(alpha) cos(theta_i))
    theta_a, cos_a, cos_half = half_vector(geometry)
    assert np.tan(theta_a) == pytest.approx(np.sqrt(across2) / -v_z, rel=1e-9, abs=1e-15)
    D = cos_half / (cos_a * np.cos(geometry.theta_i))
    assert geometric_factor(geometry) == pytest.approx(D, rel=1e-9)


LOBES = Geometry.from_degrees(
    theta_i=np.array([0.0, 20.0, 50.0, 75.0])[:, None, None],
    theta_r=np.array([0.0, 21.0, 55.0, 70.0])[:, None],
    dphi=[180.0, 170.0, 90.0, 0.0],
)


def test_a_smooth_surface_has_the_first_term_and_a_plane_no_lobe() -> None:
    for sigma_h, tolerance in ((1e-6, 1e-9), (1e-3, 1e-3)):
        found, first = (f(LOBES, 1.0, sigma_h, 0.4) for f in (lobe_brdf, smooth_lobe_brdf))
        np.testing.assert_allclose(found, first, rtol=tolerance)
    values = {"scale": 1.0, "sigma_h": 0.0, "correlation_length": 5.0}
    assert np.all(MODEL.brdf(LOBES, **values) == 0)
    gradient = MODEL.gradient(LOBES, **values)
    assert all(np.all(slope == 0) for slope in gradient.values())


@pytest.mark.parametrize("sigma_h", [2.0, 10.0, 70.0])
def test_a_rough_surface_has_the_lobe_of_geometrical_optics(sigma_h: float) -> None:
    """(79) is a lobe of mirrors, and (77) is nearer to it than 2/g on the mirror direction."""
    T = 8 * sigma_h
    mirror = Geometry.from_degrees(theta_i=[0.0, 40.0, 70.0], theta_r=[0.0, -40.0, -70.0])
    g = optical_roughness(mirror, sigma_h)
    ratio = rough_lobe_brdf(mirror, 1.0, sigma_h, T) / lobe_brdf(mirror, 1.0, sigma_h, T)
    assert np.all(np.abs(ratio - 1) < 2 / g)
    m2 = slope_scale(sigma_h, T) ** 2

    def facets(theta: FloatArray) -> FloatArray:  # P cos(theta_a) of the docstring
        return np.exp(-np.square(np.tan(theta)) / m2) / (math.pi * m2 * np.cos(theta) ** 3)

    lit = Geometry.from_degrees(theta_i=[0.0, 30.0, 50.0], theta_r=[20.0, -25.0, -45.0])  # G = 1
    np.testing.assert_allclose(
        rough_lobe_brdf(lit, 1.0, sigma_h, T), torrance_sparrow_full(lit, 1.0, facets), rtol=1e-12
    )


@pytest.mark.parametrize(("sigma_h", "length"), [(0.03, 10.0), (0.1, 10.0), (0.3, 30.0)])
@pytest.mark.parametrize("theta_i", [0.0, 40.0])
def test_lobe_and_spike_share_the_light(sigma_h: float, length: float, theta_i: float) -> None:
    """A perfect conductor: spike e^-g and lobe 1 - e^-g, g of the mirror direction."""
    g = (4 * math.pi * sigma_h * math.cos(math.radians(theta_i))) ** 2
    found = hemispherical_reflectance(
        "beckmann_spizzichino", theta_i, nodes=300,
        scale=1.0, sigma_h=sigma_h, correlation_length=length,
    )  # fmt: skip
    assert found == pytest.approx(1 - math.exp(-g), rel=2e-4)


def test_the_spike_reflects_its_part() -> None:
    """At normal incidence, over directions sines within 0.2: sinc^2 leaves 1/(pi L) outside."""
    sine = np.linspace(-0.2, 0.2, 801)
    u, v = np.meshgrid(sine, sine, sparse=True)
    geometry = Geometry.from_degrees(
        theta_i=0.0,
        theta_r=np.degrees(np.arcsin(np.hypot(u, v))),
        dphi=np.degrees(np.arctan2(v, u)),
    )
    X, Y, sigma_h = 50.0, 30.0, 0.05
    f = spike_brdf(geometry, 1.0, sigma_h, X, Y)
    found = float(np.sum(f)) * (sine[1] - sine[0]) ** 2  # cos(theta_r) dw = du dv
    left = [1 - 1 / (math.pi * 2 * math.pi * 0.2 * side) for side in (X, Y)]
    # e^-g, of the mirror direction, grows by 0.2 % over these angles
    assert found == pytest.approx(
        math.exp(-((4 * math.pi * sigma_h) ** 2)) * left[0] * left[1], rel=2e-3
    )
    peak = spike_brdf(Geometry.from_degrees(theta_i=0, theta_r=0), 0.5, 0.0, X, Y)
    assert peak == pytest.approx(0.5 * 4 * X * Y, rel=1e-15)


def test_the_spike_is_reciprocal_in_the_mirror_direction_only() -> None:
    def spike(i: float, r: float) -> float:
        there = Geometry.from_degrees(theta_i=i, theta_r=r, dphi=180.0)
        return float(spike_brdf(there, 1.0, 0.05, 3.0, 3.0))

    assert spike(40.0, 40.0) == spike(40.0, 40.0)
    # by (cos_i/cos_r)^2: 6.4 % here
    ratio = (math.cos(math.radians(40.0)) / math.cos(math.radians(42.0))) ** 2
    assert spike(40.0, 42.0) / spike(42.0, 40.0) == pytest.approx(ratio, rel=1e-10)
    assert ratio == pytest.approx(1.0626, abs=1e-4)


@given(
    theta_i=st.floats(0, 89), theta_r=st.floats(0, 89), dphi=st.floats(0, 360),
    sigma_h=st.floats(0, 100), length=st.floats(0.1, 1000),
)  # fmt: skip
def test_the_lobe_is_reciprocal_and_not_negative(
    theta_i: float, theta_r: float, dphi: float, sigma_h: float, length: float
) -> None:
    values = {"scale": 1.0, "sigma_h": sigma_h, "correlation_length": length}
    there = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    back = exchanged(there, same_dphi=True)
    f = MODEL.brdf(there, **values)
    assert f >= 0
    assert MODEL.brdf(back, **values) == pytest.approx(f, rel=1e-9, abs=1e-280)


@pytest.mark.parametrize(
    ("sigma_h", "length"), [(0.01, 2.0), (0.3, 6.0), (1.5, 9.0), (60.0, 300.0)]
)
def test_gradient_is_that_of_central_differences(sigma_h: float, length: float) -> None:
    values = {"scale": 0.7, "sigma_h": sigma_h, "correlation_length": length}
    found = MODEL.gradient(LOBES, **values)
    level = MODEL.brdf(LOBES, **values)
    for name, value in values.items():
        h = 3e-5 * value
        expected = central_difference(
            lambda x, name=name: MODEL.brdf(LOBES, **{**values, name: x}), value, h
        )
        error = np.abs(found[name] - expected)
        assert np.all(error <= 1e-6 * np.abs(expected) + 1e-8 * level / value + 1e-250), name


def test_the_closed_domain_and_both_sides_of_validity() -> None:
    ends = np.array([0.0, 45.0, 89.999, 90.0])
    geometry = Geometry.from_degrees(
        theta_i=ends[:, None, None], theta_r=ends[:, None], dphi=[0.0, 90.0, 180.0]
    )
    for sigma_h in (0.0, 1e-9, 0.5, 100.0):
        for length in (0.1, 10.0, 1000.0):
            values = {"scale": 10.0, "sigma_h": sigma_h, "correlation_length": length}
            with np.errstate(all="raise"):
                f = MODEL.brdf(geometry, **values)
                gradient = MODEL.gradient(geometry, **values)
            assert np.all(np.isfinite(f) & (f >= 0))
            assert f.dtype == np.float64
            assert all(np.all(np.isfinite(s)) for s in gradient.values())
            valid = MODEL.validity(geometry, **values)
            assert not np.any(valid.mask[3])
            assert not np.any(valid.mask[:, 3])
            assert "shadowed" in valid.reason


def test_validity_ends_where_facets_are_shadowed() -> None:
    # tan(alpha_0) = 2 * 0.5 / 5: shadows from 90 - 11.31 degrees on
    geometry = Geometry.from_degrees(theta_i=30.0, theta_r=[0.0, 78.6, 78.8, 90.0])
    valid = MODEL.validity(geometry, scale=1.0, sigma_h=0.5, correlation_length=5.0)
    assert valid.mask.tolist() == [True, True, False, False]
    assert "78.7 degrees" in valid.reason
    # radius of curvature 1/(2 sqrt(3) 0.5) = 0.58 wavelengths: Kirchhoff's assumption fails
    sharp = MODEL.validity(geometry, scale=1.0, sigma_h=0.5, correlation_length=1.0)
    assert not np.any(sharp.mask)
    assert "Kirchhoff" in sharp.reason
    # beyond it (79) grows without limit as printed, up to 1/cos
    grazing = Geometry.from_degrees(theta_i=60.0, theta_r=[-89.0, -89.9, -89.99])
    f = MODEL.brdf(grazing, scale=1.0, sigma_h=3.0, correlation_length=6.0)
    assert f[2] / f[1] == pytest.approx(10, rel=0.02)


def test_the_terms_of_a_value_serve_its_derivatives(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are most of the cost of either."""
    asked = list[FloatArray]()

    def counted(g: FloatArray, q: FloatArray) -> Iterator[Terms]:
        asked.append(g)
        return poisson_terms(g, q)

    monkeypatch.setattr(beckmann_spizzichino, "poisson_terms", counted)
    geometry = Geometry.from_degrees(theta_i=30.0, theta_r=np.linspace(-75, 75, 50))
    for number, sigma_h in enumerate((0.3, 0.7), 1):
        values = {"scale": 1.0, "sigma_h": sigma_h, "correlation_length": 10.0}
        MODEL.brdf(geometry, **values)
        MODEL.gradient(geometry, **values)
        assert len(asked) == number
