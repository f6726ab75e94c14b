"""Every method's bound is one: inside the stated error, everywhere, over all of a range."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.accuracy import failure_maps
from analysis.accuracy.cheapest import PHYSICS
from analysis.accuracy.failure_maps import ABSOLUTE, RELATIVE, maps
from analysis.accuracy.method import Physics, Ranges
from analysis.accuracy.rough_surface import FINE_LIMIT_DEG
from analysis.models.rough.form_error import LIMIT_DEG
from analysis.models.rough.oren_nayar_exact import FINE, Rule, oren_nayar_exact_brdf
from instrument.geometry import FloatArray, Geometry
from tests.support.cpu_time import cpu_seconds

Random = np.random.Generator

TWICE = Rule(2 * FINE.slopes, 2 * FINE.per_e, 2 * FINE.azimuths)
SPANS: dict[str, tuple[float, float]] = {  # where geometric, the logarithm is drawn evenly
    "scale": (1e-3, 10.0),
    "sigma_h": (1e-2, 100.0),
    "correlation_length": (0.1, 1000.0),
}


def angles(random: Random, count: int, limit_deg: float = LIMIT_DEG) -> Geometry:
    """Directions of all kinds: anywhere, in the plane of incidence, equal, grazing, mirrored."""
    theta_i, theta_r = random.uniform(0, limit_deg, (2, count))
    dphi = random.uniform(0, 360, count)
    kind = random.integers(0, 6, count)
    dphi = np.where(kind == 1, random.choice([0.0, 180.0], count), dphi)
    dphi = np.where(kind == 2, 180 + random.normal(0, 3, count), dphi)
    theta_r = np.where((kind == 2) | (kind == 3), theta_i, theta_r)
    theta_i = np.where(kind == 4, random.uniform(0.85 * limit_deg, limit_deg, count), theta_i)
    return Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)


def drawn_ranges(random: Random, physics: Physics, points: float = 0.5) -> dict[str, tuple]:
    """A range of each parameter, or, with the probability `points`, a known value."""
    found = {}
    for p in physics.parameters:
        geometric = p.name in SPANS
        low, high = np.log(SPANS[p.name]) if geometric else (p.low, p.high)
        half = 0.0 if random.random() < points else random.uniform(0, 0.1 if geometric else 0.3)
        middle = random.uniform(low, high)
        ends = [max(low, middle - half * (high - low)), min(high, middle + half * (high - low))]
        if geometric:  # rounding may lead out of the domain
            ends = [min(max(float(np.exp(e)), p.low), p.high) for e in ends]
        found[p.name] = (float(ends[0]), float(ends[1]))
    return found


def within(random: Random, ranges: Ranges) -> dict[str, float]:
    """Parameters from their ranges, an end as likely as all between."""
    values = {}
    for name, (low, high) in ranges.items():
        value = random.choice([low, high, random.uniform(low, high)])
        values[name] = float(value) if name != "albedo" else max(float(value), 1e-9)
    return values


@pytest.mark.parametrize("name", PHYSICS)
@settings(max_examples=12)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_method_is_further_off_than_its_bound(name: str, seed: int) -> None:
    physics, random = PHYSICS[name], np.random.default_rng(seed)
    geometry = angles(random, 60 if name == "rough" else 300)
    ranges = drawn_ranges(random, physics)
    bounds = {m.name: m.bound(geometry, ranges) for m in physics.methods}
    for _ in range(3):
        values = within(random, ranges)
        exact = physics.reference.kernel(geometry, **values)
        for method in physics.methods[:-1]:
            off = np.abs(physics.off(method.kernel(geometry, **values), exact))
            allowed = bounds[method.name] * (1 + 1e-9) + physics.accuracy(geometry)
            worst = np.argmax(off - allowed)
            assert np.all(off <= allowed), (method.name, values, off[worst], allowed[worst])


@settings(max_examples=8)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_closer_bound_of_a_form_is_one_and_is_closer(seed: int) -> None:
    physics, random = PHYSICS["rough"], np.random.default_rng(seed)
    geometry, ranges = angles(random, 60), drawn_ranges(random, physics)
    for method in physics.methods:
        if method.closer is None:
            continue
        bound, closer = method.bound(geometry, ranges), method.closer(geometry, ranges)
        for _ in range(3):
            values = within(random, ranges)
            exact = physics.reference.kernel(geometry, **values)
            off = np.abs(physics.off(method.kernel(geometry, **values), exact))
            assert np.all(off <= closer + 1e-8), (method.name, values)
        if all(low == high for low, high in ranges.values()):
            assert np.median(closer) <= np.median(bound) * 1.01 + 1e-6


def test_the_finest_rule_is_good_to_its_accuracy_up_to_its_limit() -> None:
    """Against twice its nodes; nearer to grazing less is promised, and kept."""
    random, physics = np.random.default_rng(4), PHYSICS["rough"]
    for low, high in ((0.0, FINE_LIMIT_DEG), (80.0, FINE_LIMIT_DEG), (FINE_LIMIT_DEG, 90.0)):
        theta_i, theta_r = random.uniform(low, high, (2, 40))
        dphi = random.uniform(0, 360, 40)
        dphi[::4] = 180.0
        geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
        for sigma_deg in (2.0, 20.0, 60.0):
            found, finer = (
                oren_nayar_exact_brdf(geometry, 1.0, sigma_deg, rule) for rule in (FINE, TWICE)
            )
            assert np.all(np.abs(found / finer - 1) <= physics.accuracy(geometry))


@given(errors=st.lists(st.floats(0, 1e3), min_size=1))
def test_levels_round_up_and_by_little(errors: list[float]) -> None:
    given_errors: FloatArray = np.array(errors)
    for scale in (RELATIVE, ABSOLUTE):
        kept = scale.errors(scale.levels(given_errors))
        assert np.all(kept >= given_errors * (1 - 1e-9))
        usual = (given_errors > scale.least) & (given_errors < 10)
        step = 2 ** (1 / scale.per_octave)
        assert np.all(kept[usual] <= given_errors[usual] * step * (1 + 1e-9))


@pytest.mark.slow
def test_the_kept_maps_are_what_the_methods_give(slow: bool) -> None:
    relative, absolute = failure_maps.lobe_maps()
    made = {"lobe": RELATIVE.levels(relative), "lobe_absolute": ABSOLUTE.levels(absolute)}
    if slow:
        made = failure_maps.computed()
        assert set(made) == set(maps())
    for name, found in made.items():
        levels, kept = found, maps()[name]
        if name == "lobe_absolute":  # below a few ulp of 1, errors are the processor's own rounding
            floor = ABSOLUTE.levels(np.array(4 * np.finfo(float).eps))
            levels, kept = np.maximum(found, floor), np.maximum(kept, floor)
        # Of rounding alone a value may stand in the next level.
        off = np.abs(levels.astype(int) - kept.astype(int))
        assert off.max() <= 1, name
        assert np.mean(off) < 1e-3, name


SCENE = np.random.default_rng(5).uniform(0, 80, (2, 2000))


def fresh() -> Geometry:
    """A scene of which nothing is kept."""
    return Geometry.from_degrees(theta_i=SCENE[0], theta_r=SCENE[1], dphi=90.0)


@pytest.mark.parametrize(
    ("name", "method", "other", "values"),
    [
        ("rough", "table", "functional", {"albedo": 0.8, "sigma_deg": 20.0}),
        ("rough", "coarse", "table", {"albedo": 0.8, "sigma_deg": 20.0}),
        ("rough", "exact", "coarse", {"albedo": 0.8, "sigma_deg": 20.0}),
        ("smooth", "order 4", "exact", {"single_scattering_albedo": 0.9, "n": 1.5}),
        ("lobe", "10 terms", "rough", {"scale": 1.0, "sigma_h": 0.3, "correlation_length": 3.0}),
        ("lobe", "adaptive", "10 terms",
         {"scale": 1.0, "sigma_h": 0.3, "correlation_length": 3.0}),
    ],
)  # fmt: skip
def test_costs_are_those_of_the_clock(
    name: str, method: str, other: str, values: dict[str, float]
) -> None:
    """The ratio of two methods' times in one run, within a factor of 2.5 either way."""
    from analysis.models.rough.oren_nayar_exact import forget
    from analysis.models.smooth import wolff

    physics = PHYSICS[name]
    ranges = {parameter: (value, value) for parameter, value in values.items()}

    def seconds(chosen: str) -> float:
        def once() -> None:
            forget()
            wolff._h_and_k_series.cache_clear()  # a fit asks with ever other parameters
            physics[chosen].kernel(fresh(), **values)

        return cpu_seconds(once, 3 if chosen in ("coarse", "exact") and name == "rough" else 9)

    def cost(chosen: str) -> float:
        return physics[chosen].cost(fresh(), ranges).of(2000)

    ratio = (seconds(method) / seconds(other)) / (cost(method) / cost(other))
    assert 1 / 2.5 < ratio < 2.5
