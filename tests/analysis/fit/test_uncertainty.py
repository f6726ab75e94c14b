"""Uncertainties: an interval where the data determine nothing, and coverage over many scans.

Fitted with the true model: 95 % intervals cover the truth in 93.5 to 96.5 % of 2000 scans, and the
standard deviation of the estimates is at most 1.05 times the Cramer-Rao bound. The whole choice:
the right physics in 95 % of 500 scans once the part of the extra term that the simpler model cannot
follow has lambda = sum((part / u)^2) = 25; the simpler model in 95 % without that term. `make test`
runs some of the scans, with wider limits accordingly; `pytest --slow` runs all. The results are
properties in the file that `--junitxml FILE` writes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping

import numpy as np
import pytest

from analysis.choice.choice import choose
from analysis.choice.ladder import CANDIDATES, physics
from analysis.data.covariance import independent_covariance
from analysis.data.measurements import Measurements
from analysis.fit.fit import FitResult, fit
from analysis.fit.search.problem import Problem
from analysis.models import MODELS
from instrument.geometry import FloatArray, Geometry
from tests.support.analysis.seeded_scan import RIG, noisy_sweeps, scan

INCIDENCES = (15.0, 30.0, 45.0, 60.0)
VIEWS = np.arange(-75.0, 76.0, 5.0)
THETA_I = np.repeat(INCIDENCES, VIEWS.size)
THETA_R = np.tile(VIEWS, len(INCIDENCES))
GEOMETRY = Geometry.from_degrees(theta_i=THETA_I, theta_r=THETA_R)
ROUGH = {"albedo": 0.8, "sigma_deg": 30.0}

TRUTHS: dict[str, dict[str, float]] = {
    "lambert": {"albedo": 0.6},
    "oren_nayar": {"albedo": 0.8, "sigma_deg": 25.0},
    "wolff": {"single_scattering_albedo": 0.9, "n": 1.5},
    "oren_nayar+torrance_sparrow": {"albedo": 0.75, "sigma_deg": 25.0, "ks": 0.1},
}

# Simpler model and its parameters; right model and its parameters.
STEPS = [
    ("lambert", {"albedo": 0.6}, "oren_nayar", {"albedo": 0.6, "sigma_deg": 25.0}),
    ("lambert", {"albedo": 0.6}, "wolff", {"single_scattering_albedo": 0.9, "n": 1.5}),
    (
        "oren_nayar",
        {"albedo": 0.75, "sigma_deg": 25.0},
        "oren_nayar+torrance_sparrow",
        {"albedo": 0.75, "sigma_deg": 25.0, "ks": 0.1},
    ),
]

# Shares of all 500 scans that are known to be below 95 %. In 1.8 % of the scans of a rough surface
# EON is chosen, which preserves energy: at a noise of 40 %, where lambda is 25, they look the same.
MISSED = {"oren_nayar": 0.936, "wolff": 0.948}

BOUNDED, FEW = 0.01, 0.004  # fractions of the scans and of the choices that `make test` runs


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


def test_one_geometry_does_not_determine_albedo_and_roughness() -> None:
    m = Measurements.bare([0.0] * 6, [0.0] * 6, 0.0, 0.2 + 1e-4 * np.arange(6), 2e-4)
    found = fit(MODELS["oren_nayar"], m)
    assert found.u["sigma_deg"] is None
    assert "sigma_deg" in found.undetermined


@pytest.mark.parametrize("name", ["oren_nayar_qualitative", "oren_nayar"])
def test_at_normal_incidence_the_roughness_is_not_determined(name: str) -> None:
    # (33) and (36) hardly change with theta_r there: any roughness fits, with its own albedo.
    found = fit(MODELS[name], noisy_sweeps(name, 0.0, VIEWS, 1, **ROUGH))
    assert found.u["sigma_deg"] is None
    low, high = found.intervals["sigma_deg"]
    assert low <= 30 <= high
    choice = choose(noisy_sweeps(name, 0.0, VIEWS, 1, **ROUGH), models=[name])
    assert choice.verdict == "not identifiable"
    assert "sigma_deg" in choice.reason


def test_at_normal_incidence_only_the_exact_form_determines_the_roughness() -> None:
    # By masking and interreflection far from the normal, which (33) and (34) neglect.
    found = fit(
        MODELS["oren_nayar_exact"], noisy_sweeps("oren_nayar_exact", 0.0, VIEWS, 1, **ROUGH)
    )
    for name, true in ROUGH.items():
        u = found.u[name]
        assert u is not None
        assert found.values[name] == pytest.approx(true, abs=4 * u)


@pytest.mark.parametrize("name", ["oren_nayar", "oren_nayar_exact"])
@pytest.mark.parametrize("seed", range(4))
def test_ten_points_near_the_normal_do_not_determine_the_roughness(name: str, seed: int) -> None:
    found = fit(MODELS[name], noisy_sweeps(name, 5.0, np.linspace(-9, 9, 10), seed, **ROUGH))
    assert found.u["sigma_deg"] is None
    low, high = found.intervals["sigma_deg"]
    assert low <= 30 <= high
    assert found.undetermined == ("sigma_deg",)
    # The albedo is correlated with the roughness: it is determined only roughly.
    low, high = found.intervals.get("albedo", (0.6, 1.0))
    assert low <= 0.8 <= high
    assert high - low > 0.1


@pytest.mark.parametrize("name", ["lambert+torrance_sparrow", "oren_nayar+torrance_sparrow_lobe"])
def test_the_strength_of_an_unsampled_lobe_is_not_determined(name: str) -> None:
    away = np.abs(THETA_R + THETA_I) > 22
    found = fit(MODELS[name], noisy_sweeps("lambert", THETA_I[away], THETA_R[away], 1, albedo=0.8))
    assert found.u["ks"] is None
    assert found.intervals["ks"] == (0.0, 10.0)
    assert "ks" in found.undetermined
    sampled = fit(MODELS[name], noisy_sweeps("lambert", THETA_I, THETA_R, 1, albedo=0.8))
    assert sampled.u["ks"] is None  # on its bound, 0 ...
    assert sampled.intervals["ks"][1] < 0.01  # ... with a small upper limit


def test_the_tail_of_a_lobe_limits_its_strength_to_an_interval() -> None:
    name = "oren_nayar+torrance_sparrow_lobe"
    truth = {"albedo": 0.8, "sigma_deg": 20.0, "ks": 0.05, "lobe_sigma_deg": 4.0}
    away = np.abs(THETA_R + THETA_I) > 22
    found = fit(MODELS[name], noisy_sweeps(name, THETA_I[away], THETA_R[away], 1, **truth))
    low, high = found.intervals["ks"]
    assert found.u["ks"] is None
    assert low < 0.05 < high < 1.0
    assert found.values["sigma_deg"] == pytest.approx(20.0, abs=4 * (found.u["sigma_deg"] or 0))


def scans(
    name: str, truth: Mapping[str, float], u_relative: float, count: int
) -> Iterator[Measurements]:
    """Scans with normal noise, each with its own seed."""
    f = MODELS[name].brdf(GEOMETRY, **truth)
    u = u_relative * f
    for seed in range(count):
        noise = np.random.default_rng((seed, len(name))).standard_normal(f.size)
        yield Measurements.bare(THETA_I, THETA_R, 0.0, f + u * noise, u)


def interval_95(result: FitResult, name: str) -> tuple[float, float]:
    u = result.u[name]
    if u is None:
        return result.intervals[name]
    return result.values[name] - 1.96 * u, result.values[name] + 1.96 * u


def cramer_rao(name: str, truth: Mapping[str, float], u_relative: float) -> FloatArray:
    """Least standard deviations of any unbiased estimate of the parameters."""
    m = next(scans(name, truth, u_relative, 1))
    problem = Problem(MODELS[name], GEOMETRY, m.brdf, independent_covariance(m))
    J = problem.jacobian(np.array([truth[p.name] for p in MODELS[name].parameters]))
    return np.sqrt(np.diag(np.linalg.inv(J.T @ J)))


@pytest.mark.slow
@pytest.mark.parametrize("name", list(TRUTHS))
def test_intervals_cover_the_truth_and_estimates_reach_the_cramer_rao_bound(
    name: str, slow: bool, record_property: Callable[[str, object], None]
) -> None:
    share = 1.0 if slow else BOUNDED
    truth, count = TRUTHS[name], round(2000 * share)
    fits = [fit(MODELS[name], m) for m in scans(name, truth, 0.01, count)]
    wider = 1 / math.sqrt(share)
    for k, parameter in enumerate(truth):
        ends = [interval_95(result, parameter) for result in fits]
        held = np.mean([low <= truth[parameter] <= high for low, high in ends])
        record_property(f"{name} {parameter}: share of 95 % intervals with the truth", float(held))
        assert abs(held - 0.95) <= 0.015 * wider, (parameter, held)
        spread = np.std([result.values[parameter] for result in fits])
        bound = cramer_rao(name, truth, 0.01)[k]
        record_property(f"{name} {parameter}: spread over the bound", float(spread / bound))
        assert spread <= (1 + 0.05 * wider) * bound, (parameter, spread / bound)


def noise_for(simpler: str, right: str, truth: Mapping[str, float], noncentrality: float) -> float:
    """Relative u at which the part that no method for `simpler` can follow has this lambda."""
    f = MODELS[right].brdf(GEOMETRY, **truth)
    m = Measurements.bare(THETA_I, THETA_R, 0.0, f, 0.01 * f)
    methods = [name for name in CANDIDATES if physics(name) == physics(simpler)]
    left = min(fit(MODELS[name], m).chi2 or 0.0 for name in methods)
    return 0.01 * math.sqrt(left / noncentrality)


@pytest.mark.slow
@pytest.mark.parametrize(("simpler", "plain", "right", "truth"), STEPS)
def test_the_right_model_is_chosen_where_the_data_allow_and_else_the_simpler_one(
    simpler: str,
    plain: dict[str, float],
    right: str,
    truth: dict[str, float],
    slow: bool,
    record_property: Callable[[str, object], None],
    request: pytest.FixtureRequest,
) -> None:
    if slow and right in MISSED:
        reason = f"{right} in {100 * MISSED[right]:.1f} % of 500 scans, where 95 % are promised"
        request.applymarker(pytest.mark.xfail(reason=reason, strict=True))
    share = 1.0 if slow else FEW
    u, count = noise_for(simpler, right, truth, 25.0), round(500 * share)
    least = 0.95 - (0 if share == 1 else 3 * math.sqrt(0.95 * 0.05 / count))
    for name, values in ((right, truth), (simpler, plain)):
        chosen = [choose(m).chosen or "" for m in scans(name, values, u, count)]
        found = np.mean([physics(c) == physics(name) for c in chosen])
        record_property(f"{name} against {simpler}: share chosen", float(found))
        assert found >= least, (name, found, sorted(set(chosen)))
