"""Covariance of measured points: whitening, shared errors, and thousands of columns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

from analysis.data import inverse_root
from analysis.data.covariance import Covariance, full_covariance, independent_covariance
from analysis.data.measurements import Measurements, SharedError
from analysis.models import MODELS
from instrument.geometry import FloatArray, Geometry
from tests.support.analysis.seeded_scan import scan
from tests.support.models.derivatives import central_difference


def matrix(C: Covariance) -> FloatArray:
    """C as a dense array (N, N)."""
    common = C.common_dense
    return np.diag(C.variance) + common @ common.T


@pytest.fixture(params=["few errors", "many errors"])
def either_root(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """The symmetric root of C, and the one for many errors."""
    monkeypatch.setattr(inverse_root, "_MANY", 100 if request.param == "few errors" else 0)


@pytest.mark.usefixtures("either_root")
def test_whitening_gives_the_chi2_of_the_full_matrix() -> None:
    rng = np.random.default_rng(3)
    C = Covariance(rng.uniform(0.5, 2, 20), rng.normal(size=(20, 4)))
    r = rng.normal(size=20)
    white = C.whiten(r)
    assert white @ white == pytest.approx(r @ np.linalg.solve(matrix(C), r), rel=1e-12)
    np.testing.assert_allclose(C.whiten(matrix(C)) @ C.whiten(np.eye(20)).T, np.eye(20), atol=1e-10)
    np.testing.assert_allclose(C.u_total**2, np.diag(matrix(C)), rtol=1e-12)
    assert C.log_determinant == pytest.approx(np.linalg.slogdet(matrix(C))[1], rel=1e-12)


@pytest.mark.usefixtures("either_root")
def test_pulls_are_the_most_likely_shared_errors() -> None:
    """Compared with the joint normal equations of points and shared errors."""
    rng = np.random.default_rng(5)
    C = Covariance(rng.uniform(0.5, 2, 20), rng.normal(size=(20, 4)))
    r = rng.normal(size=20)
    weighted = C.common.T / C.variance
    expected = np.linalg.solve(weighted @ C.common + np.eye(4), weighted @ r)
    assert C.pulls(r) == pytest.approx(expected, rel=1e-9)


def test_shared_errors_stand_at_the_right_points_of_the_matrix() -> None:
    m = scan("oren_nayar", 1, albedo=0.8, sigma_deg=30)
    reading = SharedError("reading", np.full(m.size, 0.002), m.lamp_setting)
    m = replace(m, shared=(*m.shared, reading))

    def smooth(geometry: Geometry) -> FloatArray:
        return MODELS["oren_nayar"].brdf(geometry, albedo=0.8, sigma_deg=30)

    f = smooth(m.geometry)
    C = matrix(full_covariance(m, smooth))
    gradient = central_difference(
        lambda x: smooth(Geometry.from_degrees(theta_i=m.theta_i_deg + x, theta_r=m.theta_r_deg)),
        0.0,
        1e-4,
    )
    a, b, far = 3, 5, m.size - 1  # two points of one lamp setting, and one of another
    tile = 0.005**2
    assert C[a, far] == pytest.approx(tile * f[a] * f[far], rel=1e-9)
    shared_ab = (tile + 0.002**2) * f[a] * f[b] + 0.02**2 * gradient[a] * gradient[b]
    assert C[a, b] == pytest.approx(shared_ab, rel=1e-4)


def test_a_shared_error_may_raise_one_point_and_lower_another() -> None:
    placement = SharedError("placement", np.array([0.01, -0.02, 0.03]), np.array([0, 0, 1]))
    m = replace(Measurements.bare(30.0, [0.0, 20.0, 40.0], 0.0, 0.2, 0.001), shared=(placement,))
    C = matrix(full_covariance(m, lambda g: np.full(g.shape, 0.2)))
    expected = np.diag([1e-6] * 3) + 0.04 * np.array(
        [[1e-4, -2e-4, 0], [-2e-4, 4e-4, 0], [0, 0, 9e-4]]
    )
    np.testing.assert_allclose(C, expected, atol=1e-15)


def test_angle_errors_at_the_edges_of_the_domain() -> None:
    m = replace(
        Measurements.bare([0.0, 0.0, 90.0, 45.0], [-90.0, 0.0, 40.0, 90.0], 0.0, 0.2, 0.001),
        u_theta_i_deg=0.5, u_theta_r_deg=0.5, u_dphi_deg=0.5,
    )  # fmt: skip
    model = MODELS["oren_nayar"]
    C = full_covariance(m, lambda g: model.brdf(g, albedo=0.8, sigma_deg=30))
    assert np.all(np.isfinite(matrix(C)))
    assert np.all(C.u_total < 0.01)


def test_the_covariance_needs_a_stated_u() -> None:
    m = Measurements.bare(30, [0, 20], 0, 0.2)
    assert independent_covariance(m).u_total.tolist() == [1, 1]
    with pytest.raises(ValueError, match="u_random is not stated"):
        full_covariance(m, lambda g: np.ones(g.shape))


def test_a_sparse_covariance_is_the_full_one() -> None:
    rng = np.random.default_rng(8)
    common = rng.normal(size=(60, 25)) * (rng.random((60, 25)) < 0.1) * 1e3
    variance, residual = rng.uniform(0.5, 2, 60), rng.normal(size=60)
    full, sparse = Covariance(variance, common), Covariance(variance, csr_array(common))
    good = rng.random(60) < 0.7
    for one, other in ((full, sparse), (full.subset(good), sparse.subset(good))):
        r = residual[: one.variance.size]
        np.testing.assert_allclose(other.whiten(r), one.whiten(r), atol=1e-9)
        np.testing.assert_allclose(other.pulls(r), one.pulls(r), atol=1e-9)
        np.testing.assert_allclose(other.u_total, one.u_total, rtol=1e-12)
        np.testing.assert_allclose(matrix(other), matrix(one), rtol=1e-12)
    white = full.whiten(residual)
    assert white @ white == pytest.approx(residual @ np.linalg.solve(matrix(full), residual))


def test_a_very_uncertain_level_leaves_the_pattern_unchanged() -> None:
    """A shared error of 10^5 u: the common level vanishes, and the rest is unchanged."""
    C = Covariance(np.ones(50), np.full((50, 1), 1e5))
    rest = np.sin(np.arange(50.0))
    rest -= rest.mean()
    np.testing.assert_allclose(C.whiten(rest + 3e4), rest, atol=0.1)
    white = C.whiten(rest)
    assert white @ white == pytest.approx(rest @ rest, rel=1e-9)
    assert C.pulls(np.full(50, 3e4))[0] == pytest.approx(0.3, rel=1e-9)
