"""Models that are special cases of others: the same BRDF, at the values that are stated."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.models import MODELS
from analysis.models.special_cases import SPECIAL_CASES, special_cases
from instrument.geometry import Geometry
from tests.support.analysis.random_fits import SUMS

LARGER = (*SPECIAL_CASES, *SUMS, "eon+ggx_f90", "oren_nayar+torrance_sparrow+single_scattering")


def random_geometry(rng: np.random.Generator, size: int = 50) -> Geometry:
    return Geometry.from_degrees(
        theta_i=rng.uniform(0, 85, size), theta_r=rng.uniform(0, 85, size),
        dphi=rng.uniform(0, 360, size),
    )  # fmt: skip


@pytest.mark.parametrize("name", LARGER)
def test_a_special_case_has_the_same_brdf(name: str) -> None:
    rng = np.random.default_rng(LARGER.index(name))
    model, geometry = MODELS[name], random_geometry(rng)
    assert special_cases(MODELS[name])
    for case in special_cases(MODELS[name]):
        smaller = MODELS[case.name]
        inside = 0
        for _ in range(10):
            values = {p.name: float(rng.uniform(p.low, p.high)) for p in smaller.parameters}
            at = case.embed(values, model)
            if all(p.low <= at[p.name] <= p.high for p in model.parameters):
                inside += 1
                np.testing.assert_allclose(
                    model.brdf(geometry, **at), smaller.brdf(geometry, **values),
                    rtol=1e-9, atol=1e-12, err_msg=case.name,
                )  # fmt: skip
        assert inside or "sigma_deg" in case.at  # which a lobe needs to be 0.5 degrees or more


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("lambert", set()),
        ("oren_nayar+ggx", {"lambert+ggx", "ggx"}),  # Fresnel's law leaves a lobe at f0 = 0
        ("wolff+torrance_sparrow", {"wolff", "torrance_sparrow"}),
        ("lambert+torrance_sparrow_lobe",
         {"lambert", "torrance_sparrow", "torrance_sparrow_lobe", "lambert+torrance_sparrow"}),
    ],
)  # fmt: skip
def test_special_cases_of_a_sum(name: str, expected: set[str]) -> None:
    assert {case.name for case in special_cases(MODELS[name])} == expected


def test_terms_that_need_different_values_of_a_shared_parameter_make_no_special_case() -> None:
    """sigma = 0 of the body would make the lobe a mirror."""
    cases = {case.name for case in special_cases(MODELS["oren_nayar+torrance_sparrow"])}
    assert "lambert+torrance_sparrow" not in cases
