"""Candidates: which method of the rough surface is fitted, automatically or by name."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.choice.choice import choose
from analysis.data.measurements import Measurements
from analysis.models import MODELS
from instrument.geometry import Geometry

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
    found = choose(oblique(0.5), method=method)
    rough = {term for c in found.candidates for term in c.model.split("+")}
    assert rough & {*FORMS, "oren_nayar_exact"} == {own}
