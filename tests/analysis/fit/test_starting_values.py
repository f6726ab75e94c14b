"""Starts of a search: the scales solved for, the grid's minima, and truths found from them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear, nnls

from analysis.data.covariance import Covariance
from analysis.data.measurements import Measurements
from analysis.fit.fit import first_fit
from analysis.fit.problem import Problem
from analysis.fit.starting_values import bounded_least_squares, starts
from analysis.models import MODELS
from instrument.geometry import FloatArray, Geometry
from tests.support.seeded_scan import scan_angles

NO_END = 1e12

# Samples as they occur. Lobes and spikes are no narrower than the scan can see: 2 degrees, at
# views 5 degrees apart.
RANGE = {
    "albedo": (0.1, 0.95), "sigma_deg": (5.0, 50.0), "ks": (0.02, 1.5),
    "lobe_sigma_deg": (2.0, 40.0), "f0": (0.02, 0.9), "alpha": (0.05, 0.8),
    "diffuse": (0.1, 0.8), "lobe": (0.02, 0.5), "spike": (0.02, 0.5), "spike_width_deg": (2.0, 8.0),
    "single_scattering_albedo": (0.3, 0.99), "n": (1.2, 2.5), "k": (0.3, 1.5),
    "roughness": (0.05, 0.95), "scale": (0.05, 2.0), "sigma_h": (0.1, 3.0),
    "correlation_length": (1.0, 30.0),
}  # fmt: skip


def stack(seed: int, columns: int, alike: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """Terms (20, 12, columns) that differ by the part `alike`, and data (20, 12)."""
    rng = np.random.default_rng(seed)
    A = alike * rng.normal(size=(20, 12, columns)) + (1 - alike) * rng.normal(size=(20, 12, 1))
    return A * 10.0 ** rng.uniform(-3, 3, size=columns), rng.normal(size=(20, 12))


@settings(derandomize=True, max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), columns=st.integers(1, 3))
def test_scales_are_those_of_nnls(seed: int, columns: int) -> None:
    A, b = stack(seed, columns)
    found, left = bounded_least_squares(A, b, np.full(columns, NO_END))
    for n in range(len(b)):
        x, norm = nnls(A[n], b[n])
        np.testing.assert_allclose(found[n], x, rtol=1e-6, atol=1e-9 * np.max(x, initial=0))
        assert left[n] == pytest.approx(norm**2, rel=1e-9)


@pytest.mark.parametrize("columns", [2, 3])
@pytest.mark.parametrize("alike", [1e-3, 1e-6, 0.0])
def test_terms_that_are_alike_explain_what_one_does(columns: int, alike: float) -> None:
    """Within what the normal equations lose: a part `alike` of 1e-6 is 1e-12 of them."""
    for seed in range(5):
        A, b = stack(seed, columns, alike)
        found, left = bounded_least_squares(A, b, np.full(columns, NO_END))
        assert np.all(found >= 0)
        for n in range(len(b)):
            _, norm = nnls(A[n], b[n])
            achieved = float(np.sum(np.square(A[n] @ found[n] - b[n])))
            assert left[n] == pytest.approx(achieved, rel=1e-3)
            assert norm**2 - 1e-9 <= achieved <= float(b[n] @ b[n]) + 1e-9
            if alike != 1e-6:  # where rounding hides the difference, any share of it will do
                assert achieved == pytest.approx(norm**2, rel=1e-6)


def test_one_scale_is_cut_at_its_bound() -> None:
    A, b = stack(3, 1)
    high = np.array([0.1 / np.abs(A).mean()])
    found, left = bounded_least_squares(A, b, high)
    assert np.any(found == high)
    for n in range(len(b)):
        reference = lsq_linear(A[n], b[n], (0, high), tol=1e-14)
        assert left[n] == pytest.approx(2 * reference.cost, rel=1e-9)


def test_several_scales_stay_within_their_bounds_and_left_is_what_they_leave() -> None:
    for seed in range(20):
        A, b = stack(seed, 3)
        high = 0.3 / np.abs(A).mean(axis=(0, 1))
        found, left = bounded_least_squares(A, b, high)
        assert np.all((found >= 0) & (found <= high * (1 + 1e-12)))
        achieved = np.sum(np.square(np.einsum("mni,mi->mn", A, found) - b), axis=1)
        assert left == pytest.approx(achieved, rel=1e-9)
        best = [2 * lsq_linear(a, y, (0, high)).cost for a, y in zip(A, b, strict=True)]
        assert np.all(left >= np.array(best) * (1 - 1e-6))
        assert np.mean(left / best) < 1.05  # good enough to begin with


def test_terms_of_zeros_are_left_at_zero() -> None:
    found, left = bounded_least_squares(np.zeros((2, 5, 2)), np.ones((2, 5)), np.ones(2))
    assert found.tolist() == [[0, 0], [0, 0]]
    assert left.tolist() == [5, 5]


def noise_free(name: str, truth: dict[str, float]) -> Measurements:
    theta_i, theta_r, dphi = scan_angles()
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    value = MODELS[name].brdf(geometry, **truth)
    return Measurements.bare(theta_i, theta_r, dphi, value, 1e-3 * value + 1e-9)


def problem_of(name: str, m: Measurements) -> Problem:
    assert m.u_random is not None
    C = Covariance(np.square(m.u_random), np.zeros((m.size, 0)))
    return Problem(MODELS[name], m.geometry, m.brdf, C)


@pytest.mark.parametrize(
    "name", ["oren_nayar_qualitative", "oren_nayar_qualitative+torrance_sparrow_lobe", "unified"]
)
def test_a_truth_on_the_grid_is_the_first_start(name: str) -> None:
    """Of models that are sums of terms in proportion to their scales."""
    parameters = MODELS[name].parameters
    truth = {p.name: 0.3 if p.scale else p.starts[3] for p in parameters}
    first, *others = starts(problem_of(name, noise_free(name, truth)), 3)
    assert dict(zip(truth, first, strict=True)) == pytest.approx(truth, rel=1e-6)
    assert len(others) <= 2


@pytest.mark.parametrize("name", ["lambert", "wolff", "eon+ggx", "unified"])
@pytest.mark.parametrize("most", [1, 2, 5])
def test_starts_lie_within_the_domain_and_off_zero(name: str, most: int) -> None:
    m = noise_free("oren_nayar", {"albedo": 0.8, "sigma_deg": 35.0})
    problem = problem_of(name, m)
    found = starts(problem, most)
    assert 1 <= len(found) <= most
    for x in found:
        assert np.all((problem.low <= x) & (x <= problem.high))
        assert all(value > 0 for value in x)


def samples(name: str, count: int) -> list[dict[str, float]]:
    """Random truths; every fourth with the narrowest lobe."""
    found = []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        truth = {p.name: float(rng.uniform(*RANGE[p.name])) for p in MODELS[name].parameters}
        if "lobe_sigma_deg" in truth and seed % 4 == 0:
            truth["lobe_sigma_deg"] = 2.0
        found.append(truth)
    return found


def missed(name: str, truth: dict[str, float], m: Measurements) -> str:
    """Which parameters a fit does not find to 1e-4, of those that a u of 0.1 % determines."""
    fitted = first_fit(MODELS[name], m)
    found = dict(zip(truth, fitted.solution.x, strict=True))
    x = np.array(list(truth.values()))
    J = problem_of(name, noise_free(name, truth)).jacobian(x) * x
    relative_u = np.sqrt(np.diag(np.linalg.pinv(J.T @ J)))
    wrong = [
        f"{parameter} {found[parameter]:g} for {value:g}"
        for (parameter, value), u in zip(truth.items(), relative_u, strict=True)
        if u < 0.5 and abs(found[parameter] / value - 1) > 1e-4
    ]
    wrong += [] if fitted.solution.converged else ["not converged"]
    return ", ".join(wrong) and f"{truth}: {', '.join(wrong)}"


@pytest.mark.parametrize("stated", [True, False], ids=["with u", "without u"])
@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("lambert", 40),
        ("minnaert", 40),
        ("oren_nayar_qualitative", 40),
        ("oren_nayar", 40),
        ("eon", 40),
        ("wolff", 8),
        ("ggx", 40),
        ("torrance_sparrow", 40),
        ("lambert+ggx", 40),
        ("lambert+torrance_sparrow", 40),
        ("minnaert+torrance_sparrow", 40),
        ("oren_nayar_qualitative+torrance_sparrow", 40),
        ("oren_nayar+torrance_sparrow", 40),
        ("oren_nayar+torrance_sparrow_lobe", 40),
        ("unified", 20),
        ("beckmann_spizzichino", 5),
        ("lambert+beckmann_spizzichino", 5),
    ],
)
def test_truths_are_found_without_a_hint(name: str, count: int, stated: bool) -> None:
    failures = []
    for truth in samples(name, count):
        m = noise_free(name, truth)
        if not stated:
            m = Measurements.bare(m.theta_i_deg, m.theta_r_deg, m.dphi_deg, m.brdf)
        failures.append(missed(name, truth, m))
    failures = [failure for failure in failures if failure]
    assert not failures, f"{len(failures)} of {count}: {failures}"


@pytest.mark.parametrize("name", ["oren_nayar_qualitative", "oren_nayar", "oren_nayar_exact"])
def test_zero_roughness_is_no_trap(name: str) -> None:
    """A surface changes with the square of its roughness: at 0 the slope is 0, up and down."""
    truth = {"albedo": 0.7, "sigma_deg": 30.0}
    problem = problem_of(name, noise_free(name, truth))
    found = problem.solve(np.array([0.6, 0.0]))
    assert found.converged
    assert found.x == pytest.approx(list(truth.values()), rel=1e-6)
    smooth = problem_of(name, noise_free("lambert", {"albedo": 0.7}))
    assert smooth.solve(np.array([0.6, 0.0])).x == pytest.approx([0.7, 0.0], abs=1e-4)
    assert problem.solve(np.array([0.6, 0.0]), held=[1]).x[1] == 0
