"""Model and sums of models: blocks, gradients, shared parameters, and refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.models import MODELS, Model, Parameter
from analysis.models.base import add, last_per_geometry
from instrument.geometry import Geometry
from tests.support.models.derivatives import central_difference
from tests.support.models.geometries import (
    exchanged,
    extreme_directions,
    parameters_at,
    random_directions,
)
from tests.support.models.names import NAMES, SUMS


def own(name: str, values: dict[str, float]) -> dict[str, float]:
    return {p.name: values[p.name] for p in MODELS[name].parameters}


@pytest.mark.parametrize("name", NAMES)
def test_evaluation_in_blocks_changes_no_value(name: str) -> None:
    model, few = MODELS[name], random_directions(40, 80.0)
    values = {p.name: p.default for p in model.parameters}
    many = Geometry.from_degrees(
        theta_i=np.tile(few.theta_i_deg, (450, 1)), theta_r=few.theta_r_deg, dphi=few.dphi_deg
    )
    found, expected = model.brdf(many, **values), model.brdf(few, **values)
    assert found.shape == (450, 40)
    assert found.dtype == np.float64
    np.testing.assert_allclose(found, np.tile(expected, (450, 1)), rtol=1e-12)


@pytest.mark.parametrize("name", SUMS)
@pytest.mark.parametrize("part", [0.1, 0.6])
def test_the_gradient_of_a_sum_is_that_of_central_differences(name: str, part: float) -> None:
    model, geometry = MODELS[name], random_directions(50, 80.0)
    values = parameters_at(model, part)
    found = model.gradient(geometry, **values)
    assert list(found) == [p.name for p in model.parameters]
    for p in model.parameters:
        expected = central_difference(
            lambda x, name=p.name: model.brdf(geometry, **{**values, name: x}),
            values[p.name],
            1e-4 * (p.high - p.low),
        )
        assert found[p.name].dtype == np.float64
        near = 2e-5 * np.max(np.abs(found[p.name])) + 1e-12
        np.testing.assert_allclose(found[p.name], expected, rtol=2e-5, atol=near)


def test_a_sum_shares_sigma_with_the_narrower_domain() -> None:
    model = MODELS["oren_nayar+torrance_sparrow"]
    assert [(p.name, p.low, p.high) for p in model.parameters] == [
        ("albedo", 0, 1), ("sigma_deg", 0.5, 60), ("ks", 0, 10)
    ]  # fmt: skip
    geometry = Geometry.from_degrees(theta_i=30, theta_r=[-50, 20])
    parts = MODELS["oren_nayar"].brdf(geometry, albedo=0.8, sigma_deg=20)
    parts = parts + MODELS["torrance_sparrow"].brdf(geometry, ks=0.1, sigma_deg=20)
    found = model.brdf(geometry, albedo=0.8, sigma_deg=20, ks=0.1)
    np.testing.assert_allclose(found, parts, rtol=1e-15)


def test_parameters_that_cannot_be_shared() -> None:
    def model(low: float, high: float, unit: str) -> Model:
        width = Parameter("width", unit, low, high, low)
        return Model("m", (width,), MODELS["lambert"].kernel)

    for other in (model(3, 4, "degrees"), model(0, 1, "radians")):
        with pytest.raises(ValueError, match="width cannot be shared"):
            add(model(0, 1, "degrees"), other)


@pytest.mark.parametrize("name", SUMS)
def test_a_sum_is_reciprocal_and_valid_where_its_parts_are(name: str) -> None:
    model, geometry = MODELS[name], extreme_directions(np.random.default_rng(23), 200)
    values = {p.name: p.default for p in model.parameters}
    parts = {part: own(part, values) for part in name.split("+")}
    back = exchanged(geometry)
    total = sum(MODELS[part].brdf(geometry, **v) for part, v in parts.items())
    found = model.brdf(geometry, **values)
    np.testing.assert_allclose(found, total, rtol=1e-14)
    if "wolff" not in parts:
        # Nearer to grazing 1/cos amplifies the rounding of dphi + 180 and -dphi.
        far = np.maximum(geometry.theta_i_deg, geometry.theta_r_deg) < 89.9
        np.testing.assert_allclose(model.brdf(back, **values)[far], found[far], rtol=1e-9)
    each = [MODELS[part].validity(geometry, **v) for part, v in parts.items()]
    validity = model.validity(geometry, **values)
    np.testing.assert_array_equal(validity.mask, np.all([v.mask for v in each], axis=0))
    assert set(validity.mask) == {True, False}
    assert all(v.reason in validity.reason for v in each)


@pytest.mark.parametrize("name", [name for name in SUMS if not name.endswith("ggx")])
def test_a_term_with_scale_0_leaves_the_others(name: str) -> None:
    # not GGX: Schlick's F keeps its grazing part at f0 = 0
    *first, last = name.split("+")
    scales = {p.name: 0.0 for p in MODELS[last].parameters if p.scale}
    values = {p.name: p.default for p in MODELS[name].parameters} | scales
    rest = sum(
        MODELS[part].brdf(random_directions(30, 80.0), **own(part, values)) for part in first
    )
    np.testing.assert_allclose(
        MODELS[name].brdf(random_directions(30, 80.0), **values), rest, rtol=1e-14
    )


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"albedo": 0.5}, "sigma_deg"),
        ({"albedo": 0.5, "sigma_deg": 61}, "61 degrees; allowed: 0 to 60 degrees"),
        ({"albedo": -0.1, "sigma_deg": 20}, r"albedo = -0.1; allowed: 0 to 1"),
        ({"albedo": math.nan, "sigma_deg": 20}, "albedo = nan"),
        ({"albedo": 0.5, "sigma_deg": math.inf}, "sigma_deg = inf"),
        ({"albedo": 0.5, "sigma_deg": 20, "ks": 0.1}, "no parameter ks"),
    ],
)
def test_wrong_parameters_are_named(values: dict[str, float], words: str) -> None:
    geometry = Geometry.from_degrees(theta_i=0, theta_r=0)
    with pytest.raises(ValueError, match=words):
        MODELS["oren_nayar"].brdf(geometry, **values)


@pytest.mark.parametrize("name", NAMES)
def test_a_value_outside_its_domain_is_refused_by_name_and_range(name: str) -> None:
    model, geometry = MODELS[name], random_directions(2, 80.0)
    good = {p.name: p.default for p in model.parameters}
    for p in model.parameters:
        below, above = p.low - 1e-6, p.high + 1e-6
        for wrong in (below, above, -math.inf, math.inf, math.nan):
            for method in (model.brdf, model.gradient, model.validity):
                with pytest.raises(ValueError, match=f"^{p.name} = ") as refused:
                    method(geometry, **{**good, p.name: wrong})
                assert f"{wrong:.12g}" in str(refused.value)
                assert f"allowed: {p.low:g} to {p.high:g}" in str(refused.value)
        with pytest.raises(ValueError, match=f"needs {p.name}"):
            model.brdf(geometry, **{k: v for k, v in good.items() if k != p.name})
    with pytest.raises(ValueError, match=r"no parameter gloss \(= 3\); it has: "):
        model.brdf(geometry, **good, gloss=3)


@pytest.mark.parametrize("value", ["thirty", None, [1.0, 2.0]])
def test_a_value_that_is_not_a_number_is_refused(value: object) -> None:
    geometry = Geometry.from_degrees(theta_i=30, theta_r=30)
    with pytest.raises(ValueError, match=r"sigma_deg = .*allowed: 0 to 60 degrees"):
        MODELS["oren_nayar"].brdf(geometry, albedo=0.5, sigma_deg=value)  # type: ignore[arg-type]  # wrong on purpose


def test_the_last_result_is_kept_for_the_same_geometry_and_parameters_alone() -> None:
    asked = []

    @last_per_geometry
    def total(geometry: Geometry, a: float, b: float) -> float:
        asked.append((a, b))
        return float(geometry.theta_i_deg.sum()) + a + b

    one, other = (Geometry.from_degrees(theta_i=[t, t], theta_r=10.0) for t in (20.0, 30.0))
    assert [total(one, 1.0, 2.0), total(one, 1.0, 2.0)] == [43.0, 43.0]
    assert asked == [(1.0, 2.0)]
    assert [total(other, 1.0, 2.0), total(one, 1.0, 3.0), total(one, 1.0, 2.0)] == [
        63.0,
        44.0,
        43.0,
    ]
    assert len(asked) == 4
