"""Candidates: methods for the rough surface, and models left out or ruled out."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.choice.candidates import Candidates
from analysis.choice.choice import choose
from analysis.data.measurements import Measurements
from analysis.models import MODELS
from instrument.errors import NotDetermined
from instrument.geometry import Geometry
from tests.support.analysis.seeded_scan import scan

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


def test_a_model_that_is_ruled_out_has_no_profiles() -> None:
    m = scan("oren_nayar", 1, albedo=0.8, sigma_deg=40)
    poor, good = Candidates.of(NAMES[:2], m, robust=False, every=True).refined(None)
    assert good.reduced_chi2 == pytest.approx(1, abs=0.5)
    assert (poor.reduced_chi2 or 0) > 25
    assert np.isfinite(poor.bic)
