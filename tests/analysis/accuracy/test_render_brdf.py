"""The BRDF for pictures keeps its tolerance and leaves cheap models as they are."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.accuracy.render_brdf import NEAR_GRAZING, TOLERANCE, adequate_brdf
from analysis.models import MODELS
from instrument.geometry import Geometry


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("oren_nayar_exact", {"albedo": 0.8, "sigma_deg": 20.0}),
        (
            "oren_nayar_exact+torrance_sparrow",
            {"albedo": 0.7, "sigma_deg": 15.0, "ks": 0.1},
        ),
    ],
)
def test_the_rendered_brdf_keeps_its_tolerance(name: str, values: dict[str, float]) -> None:
    random = np.random.default_rng(6)
    theta_i, theta_r = random.uniform(0, 89, (2, 6, 30))
    there = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=180.0)
    found = adequate_brdf(name, values)(there)
    exact = MODELS[name].brdf(there, **values)
    assert found.shape == (6, 30)
    allowed = np.where(np.maximum(theta_i, theta_r) > 85, NEAR_GRAZING, TOLERANCE)
    assert np.all(np.abs(found / exact - 1) <= allowed + 1e-6)


@pytest.mark.parametrize(
    "name",
    ["lambert", "oren_nayar", "wolff", "beckmann_spizzichino", "oren_nayar+torrance_sparrow"],
)
def test_models_without_a_cheaper_method_are_bitwise_the_same(name: str) -> None:
    there = Geometry.from_degrees(theta_i=30.0, theta_r=np.linspace(-80, 80, 33))
    values = {p.name: p.default for p in MODELS[name].parameters}
    found, expected = adequate_brdf(name, values)(there), MODELS[name].brdf(there, **values)
    assert found.tobytes() == expected.tobytes()
