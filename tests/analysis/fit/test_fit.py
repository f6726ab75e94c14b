"""Fits: truths come back with the stated uncertainty, and nothing is claimed that is not known."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from analysis.data.covariance import Covariance, independent, shared
from analysis.data.measurements import Measurements, SharedError
from analysis.fit.fit import fit
from analysis.fit.problem import Problem
from analysis.fit.profile_likelihood import interval
from analysis.models import MODELS
from instrument.errors import NotDetermined
from instrument.geometry import FloatArray, Geometry
from tests.support.seeded_scan import GLOSSY, RIG, scan


def tile_of(m: Measurements, u_relative: float) -> SharedError:
    return SharedError.of_all("white tile", u_relative, m.size)


def test_whitening_gives_the_chi2_of_the_full_matrix() -> None:
    rng = np.random.default_rng(3)
    C = Covariance(rng.uniform(0.5, 2, 20), rng.normal(size=(20, 4)))
    r = rng.normal(size=20)
    white = C.whiten(r)
    assert white @ white == pytest.approx(r @ np.linalg.solve(C.matrix(), r), rel=1e-12)
    np.testing.assert_allclose(
        C.whiten(C.matrix()) @ C.whiten(np.eye(20)).T, np.eye(20), atol=1e-10
    )
    np.testing.assert_allclose(C.u_total**2, np.diag(C.matrix()), rtol=1e-12)


def test_the_pulls_are_the_likeliest_shared_errors() -> None:
    """Against the normal equations of points and shared errors taken together."""
    rng = np.random.default_rng(5)
    C = Covariance(rng.uniform(0.5, 2, 20), rng.normal(size=(20, 4)))
    r = rng.normal(size=20)
    weighted = C.common.T / C.variance
    expected = np.linalg.solve(weighted @ C.common + np.eye(4), weighted @ r)
    assert C.pulls(r) == pytest.approx(expected, rel=1e-9)


def test_a_tile_reading_that_is_off_is_named_and_leaves_no_pattern() -> None:
    m = scan("oren_nayar", 1, albedo=0.8, sigma_deg=30)
    reading = SharedError("reading", np.full(m.size, 0.002), m.lamp_setting)
    m = replace(m, shared=(*m.shared, reading))
    off = np.where(reading.group == 1, 1.01, 1.0)  # five times the u of one tile reading
    found = fit(MODELS["oren_nayar"], replace(m, brdf=m.brdf * off))
    pulls = {n: p for n, p in found.pulls.items() if n.startswith("reading")}
    assert max(pulls, key=lambda name: pulls[name]) == "reading 2"
    assert pulls["reading 2"] > 2
    assert found.residuals.std() == pytest.approx(1.0, abs=0.3)
    assert abs(found.residuals.mean()) < 0.3


def test_shared_errors_are_where_they_belong() -> None:
    m = scan("oren_nayar", 1, albedo=0.8, sigma_deg=30)
    reading = SharedError("reading", np.full(m.size, 0.002), m.lamp_setting)
    m = replace(m, shared=(*m.shared, reading))

    def smooth(geometry: Geometry) -> FloatArray:
        return MODELS["oren_nayar"].brdf(geometry, albedo=0.8, sigma_deg=30)

    f = smooth(m.geometry)
    C = shared(m, smooth).matrix()
    step = 1e-4
    up = smooth(Geometry.from_degrees(theta_i=m.theta_i_deg + step, theta_r=m.theta_r_deg))
    down = smooth(Geometry.from_degrees(theta_i=m.theta_i_deg - step, theta_r=m.theta_r_deg))
    slope = (up - down) / (2 * step)
    a, b, far = 3, 5, m.size - 1  # two points of one lamp setting, and one of another
    tile = 0.005**2
    assert C[a, far] == pytest.approx(tile * f[a] * f[far], rel=1e-9)
    shared_ab = (tile + 0.002**2) * f[a] * f[b] + 0.02**2 * slope[a] * slope[b]
    assert C[a, b] == pytest.approx(shared_ab, rel=1e-4)


def test_a_shared_error_may_raise_one_point_and_lower_another() -> None:
    placement = SharedError("placement", np.array([0.01, -0.02, 0.03]), np.array([0, 0, 1]))
    m = replace(Measurements.bare(30.0, [0.0, 20.0, 40.0], 0.0, 0.2, 0.001), shared=(placement,))
    C = shared(m, lambda g: np.full(g.shape, 0.2)).matrix()
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
    C = shared(m, lambda g: model.brdf(g, albedo=0.8, sigma_deg=30))
    assert np.all(np.isfinite(C.matrix()))
    assert np.all(C.u_total < 0.01)


@pytest.mark.parametrize(("sigma", "albedo", "ks"), GLOSSY)
def test_pulls_are_standard_normal(sigma: float, albedo: float, ks: float) -> None:
    model = MODELS["oren_nayar+torrance_sparrow"]
    truth = {"albedo": albedo, "sigma_deg": sigma, "ks": ks}
    pulls, chi2 = [], []
    for seed in range(20):
        found = fit(model, scan(model.name, seed, **truth))
        pulls.append([(found.values[n] - truth[n]) / (found.u[n] or np.nan) for n in truth])
        chi2.append(found.reduced_chi2)
    # 20 scans: the mean of a pull is known to 0.22, its spread to 0.16; 3.5 times that is allowed.
    assert np.all(np.abs(np.mean(pulls, axis=0)) < 0.8)
    assert np.all(np.abs(np.std(pulls, axis=0) - 1) < 0.56)
    assert np.mean(np.array(chi2, dtype=float)) == pytest.approx(1, abs=0.12)


def test_the_tile_s_error_goes_to_the_albedo_alone() -> None:
    # Of the model that is proportional to its albedo: interreflection (34), which is not, tells
    # the albedo from the tile's error a little.
    model = MODELS["oren_nayar_qualitative"]
    m = scan(model.name, 5, u_tile=0.0, albedo=0.8, sigma_deg=30)
    assert m.u_random is not None
    off = replace(m, brdf=m.brdf * 1.01, u_random=m.u_random * 1.01, shared=(tile_of(m, 0.005),))
    exact, scaled = fit(model, m), fit(model, off)
    assert (exact.u["albedo"] or 1) < 0.0005
    assert scaled.u["albedo"] == pytest.approx(0.005 * 0.808, rel=0.02)
    assert scaled.values["albedo"] == pytest.approx(1.01 * exact.values["albedo"], rel=1e-5)
    assert scaled.values["sigma_deg"] == pytest.approx(exact.values["sigma_deg"], rel=1e-4)
    assert scaled.u["sigma_deg"] == pytest.approx(exact.u["sigma_deg"], rel=1e-2)
    assert scaled.chi2 == pytest.approx(exact.chi2, rel=1e-3)


def test_no_pull_towards_low_points() -> None:
    # Peelle's puzzle: two values, 1.5 and 1.0, each 10 % and 20 % in common, do not average 0.88.
    m = Measurements.bare(30.0, [0.0, 20.0], 0.0, [0.15, 0.10], [0.015, 0.010])
    m = replace(m, shared=(tile_of(m, 0.2),))
    found = fit(MODELS["lambert"], m)
    assert 0.10 < found.values["albedo"] / np.pi < 0.15


def test_a_wrong_model_is_not_excused_by_shared_errors() -> None:
    found = fit(MODELS["lambert"], scan("oren_nayar", 2, albedo=0.8, sigma_deg=40))
    assert found.values["albedo"] == pytest.approx(0.56, abs=0.06)  # about the data's mean
    assert (found.reduced_chi2 or 0) > 1000
    assert 0.05 < found.rms_relative < 0.5


def test_the_lobe_of_a_matte_sample_is_not_determined() -> None:
    found = fit(MODELS["lambert+torrance_sparrow"], scan("lambert", 1, albedo=0.8))
    assert found.u["sigma_deg"] is None
    assert found.intervals["sigma_deg"] == (0.5, 60.0)
    assert "sigma_deg" in found.undetermined
    assert found.u["albedo"] == pytest.approx(0.004, rel=0.1)
    assert np.isnan(found.correlation[2, 2])


def test_a_value_on_its_bound_has_no_u() -> None:
    model = MODELS["oren_nayar+torrance_sparrow"]
    scans = (scan("oren_nayar", n, albedo=0.8, sigma_deg=40, acceptance=RIG) for n in range(8))
    fits = (fit(model, m, RIG) for m in scans)
    found = next(result for result in fits if result.values["ks"] == 0)  # half of all seeds
    assert found.u["ks"] is None
    assert found.intervals["ks"][0] == 0
    assert 0 < found.intervals["ks"][1] < 1e-3
    assert found.undetermined == ()
    bound = fit(MODELS["lambert"], Measurements.bare(30, [0, 20, 40], 0, 0.33, 1e-4))
    assert bound.values["albedo"] == 1
    assert bound.u["albedo"] is None
    assert bound.undetermined == ()


def test_one_geometry_does_not_tell_albedo_from_roughness() -> None:
    m = Measurements.bare([0.0] * 6, [0.0] * 6, 0.0, 0.2 + 1e-4 * np.arange(6), 2e-4)
    found = fit(MODELS["oren_nayar"], m)
    assert found.u["sigma_deg"] is None
    assert "sigma_deg" in found.undetermined


def test_the_interval_of_a_straight_line_is_1_96_u() -> None:
    geometry = Geometry.from_degrees(theta_i=30, theta_r=[0.0, 20.0, 40.0])
    C = Covariance(np.full(3, 1e-6), np.zeros((3, 0)))
    problem = Problem(MODELS["lambert"], geometry, np.array([0.159, 0.160, 0.161]), C)
    best = problem.solve(np.array([0.4]))
    u = np.pi * 1e-3 / np.sqrt(3)
    low, high = interval(problem, best, 0)
    assert low == pytest.approx(0.16 * np.pi - 1.96 * u, abs=0.03 * u)
    assert high == pytest.approx(0.16 * np.pi + 1.96 * u, abs=0.03 * u)


def test_averaging_is_used_where_it_matters() -> None:
    truth = {"albedo": 0.8, "sigma_deg": 20.0, "ks": 0.076}
    model = MODELS["oren_nayar+torrance_sparrow"]
    m = scan(model.name, 4, acceptance=RIG, **truth)
    found = fit(model, m, RIG)
    assert found.averaged
    assert found.converged
    assert (found.reduced_chi2 or 9) < 1.5 < (fit(model, m).reduced_chi2 or 0)
    for name, value in truth.items():
        assert found.values[name] == pytest.approx(value, abs=4 * (found.u[name] or 0))
    assert not fit(MODELS["lambert"], scan("lambert", 4, acceptance=RIG, albedo=0.8), RIG).averaged


def test_without_stated_u_the_noise_is_estimated() -> None:
    m = scan("oren_nayar", 6, albedo=0.8, sigma_deg=30, u_tile=0.0, u_deg=0.0)
    bare = Measurements.bare(m.theta_i_deg, m.theta_r_deg, m.dphi_deg, m.brdf)
    found = fit(MODELS["oren_nayar"], bare)
    assert found.chi2 is None
    assert found.reduced_chi2 is None
    assert found.values["sigma_deg"] == pytest.approx(30, abs=4 * (found.u["sigma_deg"] or 0))
    assert found.rms_relative == pytest.approx(5e-4, rel=0.3)


def test_too_few_points() -> None:
    two = Measurements.bare(30, [0, 20], 0, 0.2, 1e-3)
    with pytest.raises(NotDetermined, match="3 parameters; 2 points"):
        fit(MODELS["lambert+torrance_sparrow"], two)
    with pytest.raises(NotDetermined, match="no u_brdf is stated"):
        fit(MODELS["oren_nayar"], Measurements.bare(30, [0, 20], 0, 0.2))
    assert fit(MODELS["oren_nayar"], two).dof == 0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"u_random": np.zeros(2)}, "u_random = 0 1/sr"),
        ({"u_random": None, "u_dphi_deg": 0.01}, "u_random must be stated"),
        ({"u_random": None, "shared": (SharedError.of_all("tile", 0.01, 2),)}, "tile is stated"),
        ({"u_dphi_deg": -1.0}, "u_dphi_deg = -1"),
        ({"brdf": np.array([0.2, np.nan])}, "brdf holds a value that is not finite"),
        ({"theta_i_deg": np.array([30.0, 95.0])}, "theta_i = 95"),
        ({"shared": (SharedError.of_all("tile", 0.1, 3),)}, "tile has the shape"),
        ({"shared": (SharedError.of_all("tile", np.nan, 2),)}, "tile holds a value"),
    ],
)
def test_wrong_measurements_are_named(change: dict[str, object], words: str) -> None:
    m = Measurements.bare(30, [0, 20], 0, 0.2, 1e-3)
    with pytest.raises(ValueError, match=words):
        replace(m, **change)  # type: ignore[arg-type]  # wrong on purpose


def test_the_covariance_needs_a_stated_u() -> None:
    m = Measurements.bare(30, [0, 20], 0, 0.2)
    assert independent(m).u_total.tolist() == [1, 1]
    with pytest.raises(ValueError, match="u_random is not stated"):
        shared(m, lambda g: np.ones(g.shape))


def test_speed_of_the_functional_model() -> None:
    rng = np.random.default_rng(0)
    n = 50_000
    geometry = Geometry.from_degrees(
        theta_i=rng.uniform(0, 85, n), theta_r=rng.uniform(0, 85, n), dphi=rng.uniform(0, 360, n)
    )
    start = time.perf_counter()
    found = MODELS["oren_nayar"].brdf(geometry, albedo=0.8, sigma_deg=30)
    took = time.perf_counter() - start
    assert took / n < 2e-6  # 0.15e-6 on a quiet machine; this only notices a blunder
    assert np.all(found > 0)
