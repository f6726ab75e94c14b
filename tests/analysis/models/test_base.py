"""What every model and every sum owes: numbers, derivatives to the bounds, and clear refusals."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable

import numpy as np
import pytest

from analysis.models import MODELS, Model
from instrument.geometry import FloatArray, Geometry

SUMS = [
    "oren_nayar+torrance_sparrow",
    "oren_nayar_exact+torrance_sparrow_lobe",
    "minnaert+beckmann_spizzichino",
    "wolff_oren_nayar+ggx",
    "wolff+eon+unified",
]
NAMES = [*MODELS, *SUMS]


def at(model: Model, part: float) -> dict[str, float]:
    """Parameters at that part of their domains."""
    return {p.name: p.low + part * (p.high - p.low) for p in model.parameters}


def scattered(count: int) -> Geometry:
    i, r, p = np.random.default_rng(21).random((3, count))
    return Geometry.from_degrees(theta_i=80 * i, theta_r=80 * r, dphi=360 * p)


def own(name: str, values: dict[str, float]) -> dict[str, float]:
    return {p.name: values[p.name] for p in MODELS[name].parameters}


# Numbers

ENDS = [0.0, 1e-300, 1e-160, 1e-9, 1e-3, 30.0, 60.0, 89.0, 90 - 1e-6, 90 - 1e-13, 90.0]
SIDES = [0.0, 360.0, 180.0, 90.0, 270.0, 1e-300, 1e-9, -1e-20, 180 - 1e-9, 180 + 3e-14, -180.0]
NEGATIVE_AS_PRINTED = ("oren_nayar", "oren_nayar+torrance_sparrow", "wolff_oren_nayar")
NEGATIVE_AS_PRINTED += ("wolff_oren_nayar+ggx",)


def cornered(random: np.random.Generator, count: int) -> Geometry:
    """Half of the angles at the ends of the domain or within rounding of each other."""
    theta = random.uniform(0, 90, (2, count))
    chosen = random.choice(ENDS, (2, count))
    theta = np.where(random.random((2, count)) < 0.6, chosen, theta)
    nearly = np.minimum(theta[0] * (1 + 1e-15 * random.integers(-3, 4, count)), 90)
    theta[1] = np.where(random.random(count) < 0.4, nearly, theta[1])
    dphi = np.where(
        random.random(count) < 0.7, random.choice(SIDES, count), random.uniform(0, 360, count)
    )
    return Geometry.from_degrees(theta_i=theta[0], theta_r=theta[1], dphi=dphi)


def cornered_values(random: np.random.Generator, model: Model) -> dict[str, float]:
    values = {}
    for p in model.parameters:
        tiny = [5e-324, 1e-308, 1e-160, 1e-20] if p.low == 0 else [np.nextafter(p.low, 9)]
        inside = [p.default, random.uniform(p.low, p.high), np.nextafter(p.high, 0)]
        values[p.name] = float(random.choice([p.low, p.high, *inside, *tiny]))
    return values


@pytest.mark.parametrize("name", NAMES)
def test_no_warning_no_nan_and_nothing_negative_anywhere(name: str) -> None:
    random, model = np.random.default_rng(22), MODELS[name]
    for _ in range(25):
        geometry, values = cornered(random, 120), cornered_values(random, model)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            brdf, validity = model.brdf(geometry, **values), model.validity(geometry, **values)
            slopes = model.gradient(geometry, **values)
        assert np.all(np.isfinite(brdf)), values
        assert all(np.all(np.isfinite(slope)) for slope in slopes.values()), values
        negative = brdf < 0
        assert not np.any(negative & validity.mask), values
        assert name in NEGATIVE_AS_PRINTED or not np.any(negative), values


@pytest.mark.parametrize("name", NAMES)
def test_large_arrays_are_as_small_ones(name: str) -> None:
    model, few = MODELS[name], scattered(40)
    values = {p.name: p.default for p in model.parameters}
    many = Geometry.from_degrees(
        theta_i=np.tile(few.theta_i_deg, (450, 1)), theta_r=few.theta_r_deg, dphi=few.dphi_deg
    )
    found, expected = model.brdf(many, **values), model.brdf(few, **values)
    assert found.shape == (450, 40)
    assert found.dtype == np.float64
    np.testing.assert_allclose(found, np.tile(expected, (450, 1)), rtol=1e-12)


def test_wolff_s_model_has_a_value_at_every_index() -> None:
    # One n in 150 has sqrt(n^2)/n above 1 by rounding, which is no cosine.
    mirror = Geometry.from_degrees(theta_i=0, theta_r=0)
    upper = np.array([(n - 1) * (n + 1) + 1 for n in np.linspace(1, 3, 4001)])
    index = np.linspace(1, 3, 4001)[np.sqrt(upper) / np.linspace(1, 3, 4001) > 1]
    assert index.size > 10
    for n in index[::5]:
        assert MODELS["wolff"].brdf(mirror, single_scattering_albedo=0.5, n=float(n)) > 0


# Derivatives


def difference(f: Callable[[float], FloatArray], x: float, step: float) -> FloatArray:
    """Derivative to one side, of fourth order: `step` of either sign."""
    f0, f1, f2, f3, f4 = (f(x + k * step) for k in range(5))
    return (-25 * f0 + 48 * f1 - 36 * f2 + 16 * f3 - 3 * f4) / (12 * step)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("part", [0.0, 1.0])
def test_the_gradient_on_a_bound_is_that_from_inside(name: str, part: float) -> None:
    model, geometry = MODELS[name], scattered(30)
    values = at(model, part)
    found = model.gradient(geometry, **values)
    for p in model.parameters:
        if p.name == "single_scattering_albedo" and part == 1:
            continue  # without limit there, as 1/sqrt(1 - rho)

        def along(x: float, name: str = p.name) -> FloatArray:
            return model.brdf(geometry, **{**values, name: x})

        step = (1 - 2 * part) * (p.high - p.low)
        either = [difference(along, values[p.name], step * h) for h in (1e-5, 1e-3)]
        scale = np.max(np.abs(either)) + 1e-12
        error = np.min(np.abs(np.array(either) - found[p.name]), axis=0)
        assert np.all(error <= 2e-5 * scale), p.name


@pytest.mark.parametrize("name", SUMS)
@pytest.mark.parametrize("part", [0.1, 0.6])
def test_the_gradient_of_a_sum_is_that_of_central_differences(name: str, part: float) -> None:
    model, geometry = MODELS[name], scattered(50)
    values = at(model, part)
    found = model.gradient(geometry, **values)
    assert list(found) == [p.name for p in model.parameters]
    for p in model.parameters:
        step = 1e-5 * (p.high - p.low)
        up, down = (
            model.brdf(geometry, **{**values, p.name: values[p.name] + s}) for s in (step, -step)
        )
        assert found[p.name].dtype == np.float64
        near = 2e-5 * np.max(np.abs(found[p.name])) + 1e-12
        np.testing.assert_allclose(found[p.name], (up - down) / (2 * step), rtol=2e-5, atol=near)


@pytest.mark.parametrize("name", NAMES)
def test_the_brdf_is_smooth_in_its_parameters(name: str) -> None:
    """Fourth differences fall as the fourth power of the step: no kink, no noise."""
    model, geometry = MODELS[name], scattered(20)
    values = at(model, 0.45)
    for p in model.parameters:
        bend = []
        for step in (4e-3, 2e-3):
            line = [
                model.brdf(geometry, **{**values, p.name: values[p.name] + k * step * p.high})
                for k in range(-2, 3)
            ]
            bend.append(np.abs(np.diff(line, 4, axis=0)[0]))
        noise = 1e-11 * np.max(np.abs(line), axis=0)
        assert np.all(bend[1] <= bend[0] / 8 + noise), p.name


# Sums


@pytest.mark.parametrize("name", SUMS)
def test_a_sum_is_reciprocal_where_its_parts_are_and_holds_where_all_do(name: str) -> None:
    model, geometry = MODELS[name], cornered(np.random.default_rng(23), 200)
    values = {p.name: p.default for p in model.parameters}
    parts = {part: own(part, values) for part in name.split("+")}
    back = Geometry.from_degrees(
        theta_i=geometry.theta_r_deg, theta_r=geometry.theta_i_deg, dphi=-geometry.dphi_deg
    )
    total = sum(MODELS[part].brdf(geometry, **v) for part, v in parts.items())
    found = model.brdf(geometry, **values)
    np.testing.assert_allclose(found, total, rtol=1e-14)
    if "wolff" not in parts:
        # Nearer to grazing 1/cos makes much of how dphi + 180 and -dphi are rounded.
        far = np.maximum(geometry.theta_i_deg, geometry.theta_r_deg) < 89.9
        np.testing.assert_allclose(model.brdf(back, **values)[far], found[far], rtol=1e-9)
    each = [MODELS[part].validity(geometry, **v) for part, v in parts.items()]
    validity = model.validity(geometry, **values)
    np.testing.assert_array_equal(validity.mask, np.all([v.mask for v in each], axis=0))
    assert set(validity.mask) == {True, False}
    assert all(v.reason in validity.reason for v in each)


@pytest.mark.parametrize("name", [name for name in SUMS if not name.endswith("ggx")])
def test_a_part_that_is_scaled_to_nothing_leaves_the_others(name: str) -> None:
    # not GGX: Schlick's F keeps its grazing part at f0 = 0
    *first, last = name.split("+")
    scales = {p.name: 0.0 for p in MODELS[last].parameters if p.scale}
    values = {p.name: p.default for p in MODELS[name].parameters} | scales
    rest = sum(MODELS[part].brdf(scattered(30), **own(part, values)) for part in first)
    np.testing.assert_allclose(MODELS[name].brdf(scattered(30), **values), rest, rtol=1e-14)


# Limits and energy that no other file states


def test_minnaert_s_law_is_lambert_s_at_k_1() -> None:
    geometry = cornered(np.random.default_rng(24), 100)
    for albedo in (0.0, 0.4, 1.0):
        found = MODELS["minnaert"].brdf(geometry, albedo=albedo, k=1.0)
        np.testing.assert_allclose(found, MODELS["lambert"].brdf(geometry, albedo=albedo))


def reflected(name: str, theta_i: float, **values: float) -> float:
    """Hemispherical reflectance, with panels that end at theta_i and at dphi = 90 degrees."""
    t, w = np.polynomial.legendre.leggauss(100)
    p, v = np.polynomial.legendre.leggauss(24)
    dphi, d_dphi = np.concatenate([45 * (p + 1), 90 + 45 * (p + 1)]), np.tile(v, 2) * np.pi / 2
    total = 0.0
    for a, b in ((0.0, theta_i), (theta_i, 90.0)):
        theta_r = a + (b - a) * (t + 1) / 2
        geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r[:, None], dphi=dphi)
        ring = MODELS[name].brdf(geometry, **values) @ d_dphi
        total += float(ring @ (np.radians(b - a) / 2 * w * np.sin(2 * np.radians(theta_r)) / 2))
    return total


@pytest.mark.parametrize(
    ("name", "sigma_deg", "most"),
    [("oren_nayar_qualitative", 11.0, 1.015), ("oren_nayar", 17.0, 1.051)],
)
def test_how_much_the_printed_forms_exceed_1(name: str, sigma_deg: float, most: float) -> None:
    # as their docstrings say
    assert reflected(name, 90.0, albedo=1.0, sigma_deg=sigma_deg) == pytest.approx(most, abs=6e-4)
    for theta_i in (0.0, 40.0, 80.0, 90.0):
        for sigma in (3.0, sigma_deg, 40.0, 60.0):
            found = reflected(name, theta_i, albedo=1.0, sigma_deg=sigma)
            assert found < most + 6e-4


# Refusals


@pytest.mark.parametrize("name", NAMES)
def test_a_value_outside_its_domain_is_refused_by_name_and_range(name: str) -> None:
    model, geometry = MODELS[name], scattered(2)
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
def test_a_value_that_is_no_number_is_refused_like_one_outside(value: object) -> None:
    geometry = Geometry.from_degrees(theta_i=30, theta_r=30)
    with pytest.raises(ValueError, match=r"sigma_deg = .*allowed: 0 to 60 degrees"):
        MODELS["oren_nayar"].brdf(geometry, albedo=0.5, sigma_deg=value)  # type: ignore[arg-type]  # wrong on purpose


@pytest.mark.parametrize(
    ("angles", "words"),
    [
        ({"theta_i": -1e-9}, "theta_i = -1e-09 degrees; allowed: 0 to 90 degrees"),
        ({"theta_i": [0, 90.0000001]}, "theta_i = 90.0000001 degrees; allowed: 0 to 90 degrees"),
        ({"theta_r": 91}, "theta_r = 91 degrees; allowed: -90 to 90 degrees"),
        ({"theta_r": [-90.5, 3]}, "theta_r = -90.5 degrees; allowed: -90 to 90 degrees"),
        ({"theta_i": math.nan}, "theta_i = nan degrees"),
        ({"theta_r": math.nan}, "theta_r = nan degrees"),
        ({"dphi": math.inf}, "dphi = inf degrees; allowed: finite degrees"),
    ],
)
def test_angles_outside_the_hemisphere_are_refused(
    angles: dict[str, float | list[float]], words: str
) -> None:
    with pytest.raises(ValueError, match=words.replace(".", r"\.")):
        Geometry.from_degrees(**{"theta_i": 10.0, "theta_r": 10.0, **angles})
