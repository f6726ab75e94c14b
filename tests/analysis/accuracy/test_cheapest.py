"""The cheapest adequate method keeps the tolerance, and no cheaper one does."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.accuracy.cheapest import CHECKS, Adequate, cheapest
from analysis.accuracy.method import Method, relative_error
from analysis.accuracy.rough_surface import ROUGH_SURFACE
from analysis.models.base import Ranges
from analysis.models.rough.form_error_table import LIMIT_DEG
from analysis.models.rough.oren_nayar_exact import FINE, clear_profile_cache, oren_nayar_exact_brdf
from instrument.geometry import Geometry
from tests.support.models.method_scenes import angles, drawn_ranges, within
from tests.support.timing.cpu_time import cpu_seconds

Random = np.random.Generator

POINT = {"albedo": (0.8, 0.8), "sigma_deg": (20.0, 20.0)}
# A method counts as more expensive from this cost ratio on.
DEARER = 1.2


def scene(random: Random) -> tuple[Geometry, Ranges, float]:
    """Up to CHECKS geometries, ranges and a tolerance, all at random."""
    count = int(np.exp(random.uniform(0, np.log(CHECKS))))
    limit_deg = random.uniform(20, LIMIT_DEG)
    geometry = angles(random, count, limit_deg)
    if random.random() < 0.3:
        theta_r = np.linspace(-limit_deg, limit_deg, count)
        geometry = Geometry.from_degrees(theta_i=random.uniform(0, limit_deg), theta_r=theta_r)
    tolerance = float(np.exp(random.uniform(np.log(1e-7), np.log(0.5))))
    return geometry, drawn_ranges(random, ROUGH_SURFACE.parameters), tolerance


def off(method: Method, geometry: Geometry, values: dict[str, float]) -> float:
    exact = ROUGH_SURFACE.reference.kernel(geometry, **values)
    return float(np.max(np.abs(relative_error(method.kernel(geometry, **values), exact))))


def breaks(method: Method, geometry: Geometry, ranges: Ranges, tolerance: float) -> bool:
    """Return True if a method exceeds the tolerance anywhere in the ranges.

    The tolerance is first reduced by the error of the reference. Only the ends of the albedo
    matter; the highest sigma is tried first.
    """
    tolerance -= 2 * float(np.max(ROUGH_SURFACE.accuracy(geometry)))
    albedos = sorted(set(ranges["albedo"]))
    sigmas = np.linspace(*reversed(ranges["sigma_deg"]), 129)
    return any(
        off(method, geometry, {"albedo": max(a, 1e-9), "sigma_deg": float(s)}) > tolerance
        for s in sigmas
        for a in albedos
    )


@pytest.mark.slow
def test_random_scenes_keep_the_tolerance_at_the_least_cost(slow: bool) -> None:
    """Five hundred scenes in the slow form."""
    random = np.random.default_rng(20)
    for _ in range(500 if slow else 12):
        geometry, ranges, tolerance = scene(random)
        found = cheapest(ROUGH_SURFACE, geometry, ranges, tolerance)
        for _ in range(6):
            values = within(random, ranges)
            assert off(ROUGH_SURFACE[found.method], geometry, values) <= tolerance, (
                found, ranges, values,
            )  # fmt: skip
        for method in ROUGH_SURFACE.methods:
            if found.cost > DEARER * method.cost.of(geometry.theta_i_deg.size):
                assert breaks(method, geometry, ranges, tolerance), (
                    found, method.name, tolerance, ranges,
                )  # fmt: skip
        clear_profile_cache()


def test_larger_scenes_keep_the_tolerance() -> None:
    """There doubtful geometries may be too many to check: the bounds nearly always suffice."""
    family, random, dearer = ROUGH_SURFACE, np.random.default_rng(3), 0
    for _ in range(3):
        geometry, ranges = angles(random, 2 * CHECKS), drawn_ranges(random, family.parameters)
        tolerance = float(np.exp(random.uniform(np.log(1e-4), np.log(0.3))))
        found = cheapest(ROUGH_SURFACE, geometry, ranges, tolerance)
        values = within(random, ranges)
        each = {m.name: off(m, geometry, values) for m in family.methods}
        assert each[found.method] <= tolerance
        costs = [m.cost.of(2 * CHECKS) for m in family.methods]
        kept = [c for c, m in zip(costs, family.methods, strict=True) if each[m.name] <= tolerance]
        dearer += found.cost > DEARER * min(kept)
        clear_profile_cache()
    assert dearer <= 1


def named(tolerance: float, **ranges: tuple[float, float]) -> Adequate:
    theta_r = np.linspace(-60, 60, 41)
    scan = Geometry.from_degrees(theta_i=30.0, theta_r=theta_r)
    return cheapest(ROUGH_SURFACE, scan, {**POINT, **ranges}, tolerance)


def test_the_method_follows_from_the_tolerance() -> None:
    """One lamp, views up to 60 degrees, sigma 20: by tolerance a form, the table, the integral."""
    assert named(0.5).method == "lambert"
    assert named(0.12).method == "qualitative"
    assert named(0.08).method == "functional"
    assert named(1e-3).method == "table"
    assert named(1e-8).method == "fine"
    assert named(1e-3, sigma_deg=(0.0, 0.0)).method == "lambert"


def test_reported_errors_and_cost_are_true() -> None:
    found = named(0.08)
    scan = Geometry.from_degrees(theta_i=30.0, theta_r=np.linspace(-60, 60, 41))
    exact = oren_nayar_exact_brdf(scan, 0.8, 20.0, FINE)
    true = np.max(np.abs(found.brdf(scan, albedo=0.8, sigma_deg=20.0) / exact - 1))
    assert found.checked <= true + 1e-5
    assert true <= min(found.predicted, 0.08)
    assert found.cost < ROUGH_SURFACE.reference.cost.of(41) / 10


def test_tolerances_per_geometry_are_independent() -> None:
    """Strict where the form is accurate and loose where it is not: the form is adequate."""
    theta = np.array([10.0, 75.0])
    there = Geometry.from_degrees(theta_i=theta, theta_r=-theta)
    form = ROUGH_SURFACE["functional"]
    exact = oren_nayar_exact_brdf(there, 0.8, 20.0, FINE)
    near, far = np.abs(form.kernel(there, albedo=0.8, sigma_deg=20.0) / exact - 1)
    assert near < far / 3
    among = ["functional"]
    each = np.array([1.05 * near, 1.05 * far])
    assert cheapest(ROUGH_SURFACE, there, POINT, each, among=among).method == "functional"
    assert cheapest(ROUGH_SURFACE, there, POINT, each[::-1], among=among).method == "fine"
    assert cheapest(ROUGH_SURFACE, there, POINT, 0.95 * far, among=among).method == "fine"


def test_beyond_the_maps_geometries_are_checked() -> None:
    """Near grazing there is no map; a few geometries are computed instead."""
    grazing = Geometry.from_degrees(theta_i=[86.0, 89.0], theta_r=[10.0, 5.0])
    found = cheapest(ROUGH_SURFACE, grazing, POINT, 0.3)
    assert found.method in ("lambert", "qualitative", "functional")
    assert np.isinf(found.predicted)
    assert 0 < found.checked <= 0.3


@pytest.mark.parametrize(
    ("ranges", "tolerance", "message"),
    [
        ({"albedo": (0.1, 0.2)}, 0.1, "rough needs a range of sigma_deg: 0"),
        ({**POINT, "n": (1, 2)}, 0.1, "rough has no parameter n; it has"),
        ({**POINT, "albedo": (0.2, 1.2)}, 0.1, "albedo = 1.2; allowed: 0 t"),
        ({**POINT, "albedo": (0.2, 0.1)}, 0.1, "allowed: low <= high"),
        (POINT, 1e-9, "tolerance = 1e-09; the most accurate method, fine"),
        (POINT, float("nan"), "tolerance = nan"),
    ],
)
def test_ranges_and_tolerances_that_are_refused(
    ranges: Ranges, tolerance: float, message: str
) -> None:
    here = Geometry.from_degrees(theta_i=10, theta_r=20)
    with pytest.raises(ValueError, match=message):
        cheapest(ROUGH_SURFACE, here, ranges, tolerance)


def test_an_unknown_method_is_refused() -> None:
    here = Geometry.from_degrees(theta_i=10, theta_r=20)
    with pytest.raises(KeyError, match="unknown method 'cubic' of rough; known: lambert, qual"):
        cheapest(ROUGH_SURFACE, here, POINT, 0.1, among=["cubic"])


def test_the_search_costs_less_than_it_saves() -> None:
    """Of 2000 geometries: where bounds suffice, a third of the integral that is avoided."""
    random = np.random.default_rng(2)
    theta_i, theta_r = random.uniform(0, 50, (2, 2000))
    anywhere = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=90.0)

    def search() -> None:
        clear_profile_cache()
        assert cheapest(ROUGH_SURFACE, anywhere, POINT, 0.035).method == "functional"

    def integrate() -> None:
        clear_profile_cache()
        oren_nayar_exact_brdf(anywhere, 0.8, 20.0)

    assert cpu_seconds(search, 3) < 0.6 * cpu_seconds(integrate, 2)


def test_beyond_its_end_the_table_is_not_used_even_for_a_smooth_surface() -> None:
    edge = Geometry.from_degrees(theta_i=90.0, theta_r=[85.0, -80.0, 0.0])
    ranges = {"albedo": (1.0, 1.0), "sigma_deg": (0.0, 0.0)}
    found = cheapest(ROUGH_SURFACE, edge, ranges, 0.3)
    values = {"albedo": 1.0, "sigma_deg": 0.0}
    assert found.brdf(edge, **values) == pytest.approx(1 / np.pi)
