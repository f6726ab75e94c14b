"""Symmetry test: rough surfaces are found, and noise or errors of angles are not roughness.

Wolff, Nayar and Oren 1998, section 3.1: at a fixed incidence a smooth surface's diffuse radiance is
symmetric about the normal; a rough one is brighter on the lamp's side; gloss on the mirror side.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from analysis.choice.symmetry_test import Symmetry, symmetry
from analysis.data.measurements import Measurements
from analysis.fit.criteria import SIGNIFICANCE
from analysis.models import MODELS
from instrument.geometry import Brdf, FloatArray, Geometry
from tests.support.analysis.seeded_scan import scan

PLASTIC = {"single_scattering_albedo": 0.9, "n": 1.5}
SMOOTH: list[tuple[str, dict[str, float]]] = [("lambert", {"albedo": 0.8}), ("wolff", PLASTIC)]
ROUGH = [20.0, 30.0, 40.0]


def brdf_of(name: str, truth: dict[str, float]) -> Brdf:
    return lambda geometry: MODELS[name].brdf(geometry, **truth)


def judged(name: str, seed: int, **truth: float) -> Symmetry:
    return symmetry(scan(name, seed, **truth), brdf_of(name, truth), 0.0)


def dense(
    name: str,
    truth: dict[str, float],
    seed: int,
    *,
    step_deg: float = 5.0,
    off_deg: float = 0.0,
    u_deg: float = 0.0,
    u_relative: float = 5e-4,
    turned: bool = False,
) -> Measurements:
    """Sweep at 45 degrees with one error of all view angles; `turned`: theta_r without signs."""
    view = np.arange(-80, 80 + step_deg, step_deg)
    view = view[np.abs(view - 45) >= 3]
    there = Geometry.from_degrees(theta_i=45.0, theta_r=view + off_deg)
    value = MODELS[name].brdf(there, **truth)
    noisy = value * (1 + u_relative * np.random.default_rng(seed).normal(size=view.size))
    dphi: FloatArray = np.where(view < 0, 180.0, 0.0) if turned else np.zeros(view.size)
    m = Measurements.bare(45.0, np.abs(view) if turned else view, dphi, noisy, u_relative * value)
    return replace(m, u_theta_r_deg=u_deg)


@pytest.mark.parametrize(("name", "truth"), SMOOTH)
def test_a_smooth_surface_is_called_smooth(name: str, truth: dict[str, float]) -> None:
    """One of 1000 scans is not: the level is 0.001. All stated uncertainties are simulated."""
    count = 200 if name == "lambert" else 60
    found = [judged(name, seed, **truth) for seed in range(count)]
    assert Counter(f.outcome for f in found)["smooth"] >= 0.99 * count
    assert found[0].pairs == 45
    probabilities = np.array([f.probability for f in found])
    assert np.mean(probabilities < 0.05) < 0.12
    assert 0.3 < np.median(probabilities) < 0.7


@pytest.mark.parametrize("sigma_deg", ROUGH)
def test_a_rough_surface_is_brighter_on_the_lamp_s_side(sigma_deg: float) -> None:
    for seed in range(20):
        found = judged("oren_nayar", seed, albedo=0.8, sigma_deg=sigma_deg)
        assert found.outcome == "rough"
        assert found.asymmetry > 0.1
        assert found.probability < 1e-9
        assert "lamp's side brighter" in str(found)


@pytest.mark.parametrize("sigma_deg", [8.0, 20.0])
def test_gloss_is_brighter_on_the_mirror_side(sigma_deg: float) -> None:
    for seed in range(20):
        found = judged("lambert+torrance_sparrow", seed, albedo=0.6, sigma_deg=sigma_deg, ks=0.1)
        assert found.outcome == "rough"
        assert found.asymmetry < -0.1
        assert "mirror side brighter" in str(found)


def test_the_asymmetry_is_the_difference_over_the_sum() -> None:
    view = np.array([-60.0, -30.0, 30.0, 60.0])
    m = Measurements.bare(45.0, view, 0.0, [0.1, 0.2, 0.3, 0.2], 0.01)
    found = symmetry(m, lambda g: np.full(g.shape, 0.2), 0.0)
    assert found.pairs == 2
    assert found.asymmetry == pytest.approx((0.1 + 0.1) / (0.5 + 0.3))
    assert "2 pairs; lamp's side brighter by 50 %" in str(found)
    far = replace(m, dphi_deg=np.full(4, 180.0))  # the same sweep, from the other side
    assert symmetry(far, lambda g: np.full(g.shape, 0.2), 0.0).asymmetry == -found.asymmetry


@pytest.mark.parametrize(
    "m",
    [
        Measurements.bare(0.0, [-40.0, -20.0, 20.0, 40.0], 0.0, [0.1, 0.2, 0.3, 0.4], 0.001),
        Measurements.bare(45.0, [10.0, 20.0, 40.0], 0.0, [0.1, 0.2, 0.3], 0.001),
        Measurements.bare(45.0, [-41.0, -21.0, 20.0, 40.0], 0.0, [0.1, 0.2, 0.3, 0.4], 0.001),
        Measurements.bare(45.0, [-40.0, 40.0], 90.0, [0.1, 0.2], 0.001),
        Measurements.bare([30.0, 60.0], [-40.0, 40.0], 0.0, [0.1, 0.2], 0.001),
        Measurements.bare(45.0, [0.0], 0.0, [0.1], 0.001),
    ],
    ids=["normal incidence", "one side", "no twins", "across", "two incidences", "one point"],
)
def test_without_mirrored_view_angles_there_is_no_test(m: Measurements) -> None:
    """Across the lamp's plane, and at normal incidence, any isotropic surface is symmetric."""
    found = symmetry(m, lambda g: np.full(g.shape, 0.2), 0.0)
    assert found == Symmetry("not tested", 0, 0.0, 1.0)
    assert "not tested" in str(found)


def test_points_without_a_mirrored_point_are_left_out() -> None:
    m = dense("lambert", {"albedo": 0.8}, 1)
    assert symmetry(m, brdf_of("lambert", {"albedo": 0.8}), 0.0).pairs == 15  # 16 less 45 degrees


@pytest.mark.parametrize("turned", [False, True], ids=["signed", "unsigned"])
@pytest.mark.parametrize("step_deg", [1.0, 5.0])
@pytest.mark.parametrize("u_deg", [0.02, 0.3, 1.0])
def test_an_error_of_the_zero_of_theta_r_is_not_roughness(
    u_deg: float, step_deg: float, turned: bool
) -> None:
    """Zero of the stage wrong by its u, in the signed and the unsigned form of the same scan."""
    smooth = brdf_of("wolff", PLASTIC)
    for sign in (-1, 1):
        for seed in range(3):
            m = dense(
                "wolff", PLASTIC, seed,
                step_deg=step_deg, off_deg=sign * u_deg, u_deg=u_deg, turned=turned,
            )  # fmt: skip
            assert symmetry(m, smooth, 0.0).outcome == "smooth"
    unknown = dense("wolff", PLASTIC, 0, step_deg=step_deg, off_deg=1.0)
    assert symmetry(unknown, smooth, 0.0).outcome == "rough"


def test_large_errors_of_angles_do_not_hide_roughness() -> None:
    truth = {"albedo": 0.8, "sigma_deg": 20.0}
    m = dense("oren_nayar", truth, 0, u_deg=1.0)
    assert symmetry(m, brdf_of("oren_nayar", truth), 0.0).outcome == "rough"


@pytest.mark.parametrize(("name", "truth"), SMOOTH)
def test_without_stated_u_the_noise_of_the_fit_is_used(name: str, truth: dict[str, float]) -> None:
    found = []
    for seed in range(100):
        m = dense(name, truth, seed, u_relative=2e-3)
        bare = Measurements.bare(m.theta_i_deg, m.theta_r_deg, m.dphi_deg, m.brdf)
        noise = 2e-3 * float(np.mean(m.brdf))
        found.append(symmetry(bare, brdf_of(name, truth), noise))
    assert Counter(f.outcome for f in found)["smooth"] >= 98
    rough = dense("oren_nayar", {"albedo": 0.8, "sigma_deg": 20.0}, 0)
    bare = Measurements.bare(rough.theta_i_deg, rough.theta_r_deg, rough.dphi_deg, rough.brdf)
    assert symmetry(bare, brdf_of("lambert", {"albedo": 0.7}), 1e-3).outcome == "rough"


def test_the_probability_is_that_of_chi2() -> None:
    """One pair, 2 standard deviations of the difference apart: 4.55 % (the normal law)."""
    u = 0.01
    m = Measurements.bare(45.0, [-30.0, 30.0], 0.0, [0.2, 0.2 + 2 * u * np.sqrt(2)], u)
    found = symmetry(m, lambda g: np.full(g.shape, 0.2), 0.0)
    assert found.probability == pytest.approx(0.0455, abs=1e-4)
    assert found.probability > SIGNIFICANCE
    assert found.outcome == "undecided"  # one pair


def test_no_verdict_where_one_pair_carries_the_comparison() -> None:
    """A peak a thousand times as bright as the other pairs: its points alone would decide."""
    view = np.arange(5.0, 80.0, 5.0)
    both = np.concatenate([view, -view])
    value = np.where(np.abs(np.abs(both) - 45) < 1, 100.0, 0.1)
    lamp = both > 0
    m = Measurements.bare(45.0, both, 0.0, np.where(lamp, 2.4 * value, value), 0.001 * value)
    found = symmetry(m, lambda g: np.full(g.shape, 0.1), 0.0)
    assert found.pairs == 15
    assert found.outcome == "undecided"
    assert found.asymmetry > 0.4


@pytest.mark.parametrize(("noise", "outcome"), [(0.002, "smooth"), (0.2, "undecided")])
def test_smooth_is_said_only_where_an_asymmetry_would_have_been_found(
    noise: float, outcome: str
) -> None:
    m = dense("lambert", {"albedo": 0.8}, 2, u_relative=0.002)
    bare = Measurements.bare(m.theta_i_deg, m.theta_r_deg, m.dphi_deg, m.brdf)
    found = symmetry(bare, brdf_of("lambert", {"albedo": 0.8}), noise)
    assert found.outcome == outcome


@pytest.mark.parametrize("level", [0.0, -1e-3])
def test_pairs_without_light_have_no_asymmetry(level: float) -> None:
    """As where the only mirrored views are at grazing angles, or in an all but dark table."""
    m = scan("lambert", 1, albedo=0.8)
    dark = replace(m, brdf=np.full(m.size, level))
    found = symmetry(dark, brdf_of("lambert", {"albedo": 0.8}), 0.1)
    assert (found.outcome, found.asymmetry) == ("undecided", 0.0)
    assert found.pairs > 0
