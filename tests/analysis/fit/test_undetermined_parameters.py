"""What data do not determine is said with an interval, never as a number with an uncertainty."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from analysis.choice.choice import choose
from analysis.data.measurements import Measurements
from analysis.fit.fit import FitResult, fit
from analysis.models import MODELS
from instrument.geometry import Geometry

VIEW = np.arange(-75.0, 76.0, 5.0)
THETA_I, THETA_R = (a.ravel() for a in np.meshgrid([15.0, 30.0, 45.0, 60.0], VIEW, indexing="ij"))
ROUGH = {"albedo": 0.8, "sigma_deg": 30.0}


def scan(
    name: str, theta_i: ArrayLike, theta_r: ArrayLike, seed: int, **truth: float
) -> Measurements:
    """Values of a model in plane, each with noise of 0.3 %."""
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r)
    f = MODELS[name].brdf(geometry, **truth)
    noise = np.random.default_rng(seed).normal(size=f.size)
    return Measurements.bare(theta_i, theta_r, 0.0, f * (1 + 0.003 * noise), 0.003 * f)


@pytest.mark.parametrize("name", ["oren_nayar_qualitative", "oren_nayar"])
def test_at_normal_incidence_the_roughness_is_not_known(name: str) -> None:
    # (33) and (36) hardly change with theta_r there: any roughness fits, each with its albedo.
    found = fit(MODELS[name], scan(name, 0.0, VIEW, 1, **ROUGH))
    assert found.u["sigma_deg"] is None
    low, high = found.intervals["sigma_deg"]
    assert low <= 30 <= high
    choice = choose(scan(name, 0.0, VIEW, 1, **ROUGH), models=[name])
    assert choice.verdict == "not identifiable"
    assert "sigma_deg" in choice.reason


def test_at_normal_incidence_only_the_exact_form_tells_the_roughness() -> None:
    # Masking and interreflection far from the normal, which (33) and (34) leave out.
    found = fit(MODELS["oren_nayar_exact"], scan("oren_nayar_exact", 0.0, VIEW, 1, **ROUGH))
    for name, true in ROUGH.items():
        u = found.u[name]
        assert u is not None
        assert found.values[name] == pytest.approx(true, abs=4 * u)


@pytest.mark.parametrize("name", ["oren_nayar", "oren_nayar_exact"])
@pytest.mark.parametrize("seed", range(4))
def test_ten_points_near_the_normal_do_not_tell_the_roughness(name: str, seed: int) -> None:
    found = fit(MODELS[name], scan(name, 5.0, np.linspace(-9, 9, 10), seed, **ROUGH))
    assert found.u["sigma_deg"] is None
    low, high = found.intervals["sigma_deg"]
    assert low <= 30 <= high
    assert found.undetermined == ("sigma_deg",)
    # The albedo goes with the roughness: within its bounds it is known a little.
    low, high = found.intervals.get("albedo", (0.6, 1.0))
    assert low <= 0.8 <= high
    assert high - low > 0.1


@pytest.mark.parametrize("name", ["lambert+torrance_sparrow", "oren_nayar+torrance_sparrow_lobe"])
def test_a_lobe_that_nobody_sampled_may_have_any_strength(name: str) -> None:
    away = np.abs(THETA_R + THETA_I) > 22
    found = fit(MODELS[name], scan("lambert", THETA_I[away], THETA_R[away], 1, albedo=0.8))
    assert found.u["ks"] is None
    assert found.intervals["ks"] == (0.0, 10.0)
    assert "ks" in found.undetermined
    sampled = fit(MODELS[name], scan("lambert", THETA_I, THETA_R, 1, albedo=0.8))
    assert sampled.u["ks"] is None  # its value lies on the bound, 0 ...
    assert sampled.intervals["ks"][1] < 0.01  # ... and can be no more than this


def test_the_tail_of_a_lobe_tells_its_strength_within_an_interval() -> None:
    name = "oren_nayar+torrance_sparrow_lobe"
    truth = {"albedo": 0.8, "sigma_deg": 20.0, "ks": 0.05, "lobe_sigma_deg": 4.0}
    away = np.abs(THETA_R + THETA_I) > 22
    found = fit(MODELS[name], scan(name, THETA_I[away], THETA_R[away], 1, **truth))
    low, high = found.intervals["ks"]
    assert found.u["ks"] is None
    assert low < 0.05 < high < 1.0
    assert found.values["sigma_deg"] == pytest.approx(20.0, abs=4 * (found.u["sigma_deg"] or 0))


@pytest.mark.parametrize(
    ("name", "truth"),
    [
        ("oren_nayar_qualitative", ROUGH),
        ("oren_nayar", ROUGH),
        ("oren_nayar_exact", ROUGH),
        ("oren_nayar+torrance_sparrow", ROUGH | {"ks": 0.3}),
    ],
)
def test_a_relative_scan_gives_the_roughness_and_no_scale(
    name: str, truth: dict[str, float]
) -> None:
    m = scan(name, THETA_I, THETA_R, 3, **truth)
    assert m.u_random is not None
    counts = replace(m, brdf=5e3 * m.brdf, u_random=5e3 * m.u_random, relative=True)
    found = fit(MODELS[name], counts)
    scales = {"albedo", "ks", "per_brdf"} & set(found.values)
    for scale in scales:
        assert found.u[scale] is None
        assert scale in found.undetermined
    assert found.values["sigma_deg"] == pytest.approx(30.0, abs=4 * (found.u["sigma_deg"] or 0))
    low, high = found.intervals["per_brdf"]
    assert low <= 5e3 <= high
    # The absolute scan knows the roughness at least as well.
    absolute = fit(MODELS[name], m).u["sigma_deg"]
    assert absolute is not None
    assert absolute < 1.1 * (found.u["sigma_deg"] or np.inf)


@cache
def relative_scan() -> tuple[Measurements, FitResult]:
    m = scan("oren_nayar", THETA_I, THETA_R, 3, **ROUGH)
    return m, fit(MODELS["oren_nayar"], replace(m, relative=True))


@given(exponent=st.floats(-9, 9))
@settings(max_examples=8)
def test_the_unit_of_a_relative_scan_does_not_matter(exponent: float) -> None:
    m, one = relative_scan()
    assert m.u_random is not None
    factor = 10.0**exponent
    scaled = replace(m, brdf=factor * m.brdf, u_random=factor * m.u_random, relative=True)
    other = fit(MODELS["oren_nayar"], scaled)
    assert other.chi2 == pytest.approx(one.chi2, rel=1e-6)
    u = one.u["sigma_deg"]
    assert u is not None
    assert abs(other.values["sigma_deg"] - one.values["sigma_deg"]) < 1e-2 * u
    assert other.u["sigma_deg"] == pytest.approx(u, rel=0.05)
