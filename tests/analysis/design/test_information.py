"""Information of planned points: the u that a fit of them will state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.data.measurements import SharedError
from analysis.design.information import Information, assumed_problem
from analysis.fit.fit import fit
from analysis.models import MODELS
from tests.support.analysis.designs import FOAM, GLOSSY, grid, information, planned

THETA_I, THETA_R = grid(np.array([30.0, 60.0]), np.linspace(-70.0, 70.0, 15))
N = THETA_I.size


def _with_shared_errors() -> tuple[SharedError, ...]:
    settings = (THETA_I > 45).astype(np.int64)
    return (
        SharedError.common_to_all("tile", 0.005, N),
        SharedError("tile reading", np.full(N, 0.002), settings),
    )


def test_u_is_that_of_generalised_least_squares() -> None:
    m = planned(
        THETA_I,
        THETA_R,
        u=0.004,
        shared=_with_shared_errors(),
        u_theta_i_deg=0.1,
        u_theta_r_deg=0.1,
    )
    problem, x = assumed_problem(GLOSSY, FOAM, m)
    J = problem.jacobian(x)
    expected = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    found = Information.of(problem, x).u(np.ones(N))
    assert list(found.values()) == pytest.approx(expected.tolist(), rel=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_u_is_that_which_the_fit_of_the_measured_points_states(seed: int) -> None:
    m = planned(THETA_I, THETA_R, u=0.004, shared=_with_shared_errors(), u_theta_i_deg=0.05)
    problem, _ = assumed_problem(GLOSSY, FOAM, m)
    noise = np.random.default_rng(seed).standard_normal(N)
    u = 0.004 * problem.brdf
    fitted = fit(GLOSSY, replace(m, brdf=problem.brdf + u * noise, u_random=u))
    stated = [value or 0.0 for value in fitted.u.values()]
    assert stated == pytest.approx(list(information(m).u(np.ones(N)).values()), rel=0.15)


def test_repeating_what_only_repeats_a_shared_error_gains_nothing() -> None:
    tile = SharedError.common_to_all("tile", 0.01, N)
    m = planned(THETA_I, THETA_R, u=1e-6, shared=(tile,))
    found = Information.of(*assumed_problem(MODELS["lambert"], np.array([0.5]), m))
    once, often = (found.u(np.full(N, times))["albedo"] for times in (1.0, 1000.0))
    assert once == pytest.approx(0.005, rel=1e-6)  # 1 % of the albedo
    assert often == pytest.approx(once, rel=1e-6)


def test_repeating_a_point_does_not_average_the_error_of_its_own_angles() -> None:
    """One point has its angles' errors alone, and yet its repetitions share them."""
    m = planned(np.array([40.0]), np.array([30.0]), u=1e-5, u_theta_i_deg=0.5, u_theta_r_deg=0.5)
    covariance = assumed_problem(MODELS["minnaert"], np.array([0.5, 0.7]), m)[0].covariance
    assert covariance.common.shape[1] == 2
    assert covariance.u_total[0] > 20 * covariance.u_independent[0]


def test_a_goal_of_the_u_that_all_points_give_weighs_as_no_goal_does() -> None:
    found = information(planned(THETA_I, THETA_R, u=0.004, shared=_with_shared_errors()))
    u = found.u(np.ones(N))
    asked = ("albedo", "sigma_deg")
    assert found.weights(asked, u) == pytest.approx(found.weights(asked))
    half = found.weights(asked, u | {"albedo": u["albedo"] / 2})
    assert half[0] == pytest.approx(4 * found.weights(asked)[0])


def test_the_parts_of_a_variance_are_those_of_the_best_estimate() -> None:
    """Each is what the error does to the estimate; random errors of a known size confirm it."""
    m = planned(THETA_I, THETA_R, u=0.004, shared=_with_shared_errors(), u_theta_i_deg=0.1)
    problem, x = assumed_problem(GLOSSY, FOAM, m)
    found = Information.of(problem, x)
    shared = found.shared_parts(np.ones(N))[1]
    W = problem.jacobian(x)
    estimate = np.linalg.solve(W.T @ W, W.T)[1]
    common = np.asarray(problem.covariance.common)
    expected = np.square(estimate @ problem.covariance.whiten(common))
    variance = found.u(np.ones(N))["sigma_deg"] ** 2
    assert shared == pytest.approx(expected / variance, rel=1e-3, abs=1e-6)
    assert 0 < shared.sum() < 1
    assert len(found.errors) == shared.size


@pytest.mark.parametrize("seed", range(5))
def test_a_further_point_never_makes_any_u_larger(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m = planned(THETA_I, THETA_R, u=0.01, shared=_with_shared_errors(), u_theta_r_deg=0.1)
    found, counts = information(m), np.zeros(N)
    before = found.u(counts)
    for point in rng.integers(0, N, 30):
        counts[point] += 1
        now = found.u(counts)
        assert all(now[name] <= before[name] * (1 + 1e-9) for name in now)
        before = now


def test_a_parameter_that_the_points_do_not_determine_has_a_u_beyond_its_domain() -> None:
    m = planned(np.full(2, 30.0), np.array([10.0, 20.0]), u=0.01)
    u = information(m).u(np.ones(2))
    assert u["ks"] > 1  # its domain is 0 to 1


def test_without_a_reference_the_roughness_is_determined_less_well() -> None:
    bare = planned(THETA_I, THETA_R, u=0.003)
    u = information(replace(bare, relative=True, free_levels=True)).u(np.ones(N))
    assert set(u) == {"albedo", "sigma_deg", "ks", "per_brdf"}
    assert information(bare).u(np.ones(N))["sigma_deg"] < u["sigma_deg"] < 3


def test_a_design_s_u_is_that_of_the_joint_covariance_of_parameters_and_errors() -> None:
    """Two ways to the same numbers, for random counts, some of them 0."""
    m = planned(THETA_I, THETA_R, u=0.004, shared=_with_shared_errors(), u_theta_i_deg=0.1)
    found = Information.of(*assumed_problem(GLOSSY, FOAM, m))
    random = np.random.default_rng(12)
    for _ in range(5):
        counts = random.integers(0, 3, N) * random.uniform(0.5, 2.0, N)
        C, K = found.covariance(counts), len(found.names)
        u = np.sqrt(np.diag(C)[:K]) * found.domain
        assert list(found.u(counts).values()) == pytest.approx(u, rel=1e-6)
        parts = np.square(C[:K, K:]) / np.diag(C)[:K, np.newaxis]
        assert found.shared_parts(counts) == pytest.approx(parts, rel=1e-5, abs=1e-9)
