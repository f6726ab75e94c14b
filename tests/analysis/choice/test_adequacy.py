"""Agreement with the data: stated u, larger u, and residuals without a stated u."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.choice.adequacy import MOST_U_SCALE, agreement, rms_judged, wide_range
from analysis.choice.choice import choose
from analysis.choice.fit_json import to_json
from analysis.choice.notes import NoteCode
from analysis.data.measurements import Measurements
from analysis.fit.fit import fit
from analysis.models import MODELS
from instrument.geometry import Geometry
from tests.support.analysis.seeded_scan import scan


@pytest.mark.parametrize("factor", [3.0, 10.0])
def test_a_stated_u_that_is_too_small_is_scaled(factor: float) -> None:
    """Normal noise of 0.5 %, stated as a fraction of that."""
    m = scan("oren_nayar", 3, u_relative=5e-3, u_deg=0.0, albedo=0.8, sigma_deg=30)
    assert m.u_random is not None
    found = choose(replace(m, u_random=m.u_random / factor), models=["lambert", "oren_nayar"])
    assert (found.chosen, found.verdict) == ("oren_nayar", "adequate")
    assert found.u_scale == pytest.approx(factor, rel=0.25)  # 96 points: 1/sqrt(2*96), 3.5 times
    written = to_json(found)
    assert written["u_scale"] == found.u_scale
    (text,) = [n["text"] for n in written["notes"] if n["code"] == NoteCode.U_TOO_SMALL]
    assert "the stated u is too small by that factor" in text
    right = choose(m, models=["oren_nayar"])
    assert right.u_scale is None
    assert "u_scale" not in to_json(right)


def test_u_is_not_blamed_for_a_misfit() -> None:
    m = scan("oren_nayar", 3, albedo=0.8, sigma_deg=20)
    one_sided = choose(m, models=["lambert"])
    assert (one_sided.verdict, one_sided.u_scale) == ("none adequate", None)
    few = Measurements.bare(30.0, [-60, -20, 20, 60], 0.0, [0.21, 0.19, 0.21, 0.19], 1e-4)
    untested = choose(few, models=["lambert"])  # the runs test cannot fail for four points
    assert untested.verdict == "none adequate"
    wild = replace(m, brdf=m.brdf * (1 + 0.3 * np.random.default_rng(0).normal(size=m.size)))
    assert choose(wild, models=["oren_nayar"]).verdict == "none adequate"  # random, but 30 %
    noisy = scan("oren_nayar", 3, u_relative=5e-3, u_deg=0.0, albedo=0.8, sigma_deg=30)
    assert noisy.u_random is not None
    for factor in (MOST_U_SCALE / 2, 2 * MOST_U_SCALE):  # random, and 0.5 %
        found = choose(replace(noisy, u_random=noisy.u_random / factor), models=["oren_nayar"])
        assert (found.verdict == "adequate") == (factor < MOST_U_SCALE)


def peak(decades: float) -> tuple[Measurements, np.ndarray]:
    """A lobe above a base that many decades lower, without u."""
    theta_r = np.arange(-70.0, 71.0, 5.0)
    shape = 10.0**-decades + np.exp(-(((theta_r + 30) / 8) ** 2))
    return Measurements.bare(30.0, theta_r, 0.0, shape), shape


@pytest.mark.parametrize(("decades", "of"), [(1.0, "the mean"), (3.0, "each value")])
def test_over_decades_the_residual_is_relative_to_each_value(decades: float, of: str) -> None:
    m, shape = peak(decades)
    assert wide_range(m) == (of == "each value")
    found = fit(MODELS["lambert"], m)
    off = replace(found, predicted=np.where(shape > 0.5, shape, 2 * shape))  # low ones off by 2
    rms, relative_to = rms_judged(replace(off, rms_relative=0.001), m)
    assert relative_to == of
    low = np.mean(shape <= 0.5)
    assert rms == pytest.approx(0.001 if of == "the mean" else 0.5 * np.sqrt(low))


def test_values_of_zero_and_below_do_not_stop_the_judgement() -> None:
    m = Measurements.bare(30.0, [0, 10, 20, 30, 40], 0.0, [0.0, 1e-3, -1e-3, 1.0, 2.0])
    assert not agreement(fit(MODELS["lambert"], m), m).agrees


def test_none_is_adequate_only_if_no_candidate_is() -> None:
    """Without u over all models at random: never "none adequate" beside one that agrees."""
    names = ["lambert", "oren_nayar", "lambert+torrance_sparrow", "lambert+ggx", "minnaert"]
    rng = np.random.default_rng(5)
    for seed in range(12):
        theta_r = np.sort(rng.uniform(-80, 80, rng.integers(7, 30)))
        g = Geometry.from_degrees(theta_i=rng.choice([20.0, 50.0]), theta_r=theta_r)
        f = MODELS["lambert+ggx"].brdf(
            g, albedo=0.5, f0=rng.uniform(0.01, 0.2), alpha=rng.uniform(0.05, 0.3)
        )
        noisy = f * (1 + 0.01 * rng.normal(size=f.size))
        found = choose(Measurements.bare(g.theta_i_deg, theta_r, 0.0, noisy), models=names)
        assert (found.verdict == "none adequate") == (not found.agreeing), seed
        assert not found.agreeing or found.chosen in found.agreeing


def test_only_the_chosen_candidate_has_intervals_and_rejected_ones_have_no_u() -> None:
    m = scan("oren_nayar", 1, albedo=0.8, sigma_deg=20)
    found = choose(m, models=["lambert", "oren_nayar", "oren_nayar+torrance_sparrow"])
    assert not any(c.intervals for c in found.candidates if c.model != found.chosen)
    for written in to_json(found)["candidates"]:
        if not written["agrees"]:
            assert all(entry["u"] is None for entry in written["parameters"].values())
    assert {c["model"] for c in to_json(found)["candidates"] if not c["agrees"]} == {"lambert"}
