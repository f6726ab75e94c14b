"""Candidates: methods for the rough surface, and models left out or ruled out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.choice.candidates import Candidates
from analysis.choice.choice import choose
from analysis.data.measurements import Measurements
from analysis.fit.fit import fit
from analysis.models import MODELS
from instrument.errors import NotDetermined
from instrument.geometry import Geometry
from tests.support.analysis.seeded_scan import RIG, scan

FORMS = ["oren_nayar_qualitative", "oren_nayar"]


def oblique(u: float) -> Measurements:
    """Exact values at oblique angles, with that relative u and without noise."""
    theta_r = np.linspace(-75, 75, 13)
    theta_i = np.repeat([60.0, 75.0], theta_r.size)
    views = np.tile(theta_r, 2)
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=views)
    f = MODELS["oren_nayar_exact"].brdf(geometry, albedo=0.8, sigma_deg=25.0)
    return Measurements.bare(theta_i, views, 0.0, f, u * f)


def test_the_exact_model_is_fitted_only_where_the_form_is_too_far_off() -> None:
    close = choose(oblique(0.005))
    assert close.chosen == "oren_nayar_exact"
    coarse = choose(oblique(0.8))
    assert "oren_nayar_exact" not in [c.model for c in coarse.candidates]


@pytest.mark.parametrize(
    ("method", "own"),
    [
        ("qualitative", "oren_nayar_qualitative"),
        ("functional", "oren_nayar"),
        ("exact", "oren_nayar_exact"),
    ],
)
def test_a_method_given_by_name_is_the_only_one(method: str, own: str) -> None:
    found = choose(oblique(0.05), method=method)
    rough = {term for c in found.candidates for term in c.model.split("+")}
    assert rough & {*FORMS, "oren_nayar_exact"} == {own}


NAMES = ("lambert", "oren_nayar", "oren_nayar_exact")


def names_of(found: Candidates) -> list[str]:
    return [f.problem.model.name for f in found.first]


@pytest.mark.parametrize(("u_relative", "integral"), [(0.3, False), (2e-4, True)])
def test_the_integral_is_fitted_only_where_its_functional_form_is_inaccurate(
    u_relative: float, integral: bool
) -> None:
    m = scan("oren_nayar", 1, u_relative=u_relative, albedo=0.8, sigma_deg=5)
    assert names_of(Candidates.of(NAMES, m, robust=False, every=True)) == list(NAMES)
    found = names_of(Candidates.of(NAMES, m, robust=False, every=False))
    assert ("oren_nayar_exact" in found) == integral


def test_models_with_too_many_parameters_are_left_out() -> None:
    two = Measurements.bare(30, [0, 20], 0, 0.2)  # without u one point more is needed
    found = Candidates.of(NAMES, two, robust=False, every=True)
    assert names_of(found) == ["lambert"]
    assert found.left_out == ("oren_nayar", "oren_nayar_exact")
    with pytest.raises(NotDetermined, match="2 points are too few to fit any of: oren_nayar"):
        Candidates.of(NAMES[1:], two, robust=False, every=True)


RIVALS = ("lambert", "wolff", "lambert+torrance_sparrow_lobe", "oren_nayar+torrance_sparrow")


@pytest.mark.parametrize("free_levels", [False, True])
def test_a_candidate_has_the_fit_that_it_has_alone(free_levels: bool) -> None:
    m = scan("oren_nayar", 1, albedo=0.8, sigma_deg=25, acceptance=RIG)
    m = replace(m, relative=free_levels, free_levels=free_levels)
    names = ("oren_nayar", *RIVALS)
    together = Candidates.of(names, m, robust=False, every=True).refined(RIG)
    for name, found in zip(names, together, strict=True):
        alone = fit(MODELS[name], m, RIG)
        assert (found.model, found.values, found.chi2) == (name, alone.values, alone.chi2)
        assert (found.bic, found.averaged) == (alone.bic, alone.averaged)


def test_a_steep_lobe_does_not_hide_its_misfit() -> None:
    """One reading 3 % too high on a flat surface, and an angle known to .02 degrees."""
    theta_r = np.arange(-75.0, 76.0, 5.0)
    value = 0.2 * (1 + 1e-3 * np.random.default_rng(1).normal(size=theta_r.size))
    value[5] *= 1.03
    m = Measurements.bare(30.0, theta_r, 0.0, value, 1e-3 * value)
    m = replace(m, u_theta_r_deg=0.02)
    lobe = fit(MODELS["lambert+torrance_sparrow_lobe"], m)
    assert (lobe.reduced_chi2 or 0) > 5
