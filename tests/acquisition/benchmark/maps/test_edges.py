"""Either side of each map's edges: inside the bound holds, outside the program says or does so."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from acquisition.measure.window import window_at
from analysis.accuracy.cheapest import cheapest
from analysis.accuracy.identifiability import LIMIT, condition, condition_map, sweep
from analysis.accuracy.render_brdf import NEAR_GRAZING, TOLERANCE, adequate_brdf
from analysis.accuracy.rough_surface import ROUGH_SURFACE
from analysis.choice.choice import choose
from analysis.data.measurements import Measurements
from analysis.fit.fit import fit
from analysis.models import MODELS
from analysis.models.rough.oren_nayar import VALID
from instrument.config.load import load_protocol
from instrument.config.protocol import FitConfig, SimulatedSample
from instrument.geometry import Geometry
from instrument.pinhole import Pinhole
from tests.support.paths import CONFIGS

FORMS = ["oren_nayar_qualitative", "oren_nayar"]


def exact_to(name: str, geometry: Geometry, values: dict[str, float]) -> float:
    """The largest error of a form against the integral."""
    exact = MODELS["oren_nayar_exact"].brdf(geometry, **values)
    return float(np.max(np.abs(MODELS[name].brdf(geometry, **values) / exact - 1), initial=0.0))


@pytest.mark.parametrize("name", FORMS)
@settings(max_examples=20)
@given(
    albedo=st.floats(0.001, 1), sigma_deg=st.floats(0.1, 60), seed=st.integers(0, 2**32 - 1)
)  # fmt: skip
def test_where_a_form_is_said_to_hold_it_is_within_a_fifth(
    name: str, albedo: float, sigma_deg: float, seed: int
) -> None:
    random = np.random.default_rng(seed)
    theta_i, theta_r = random.uniform(0, 90, (2, 40))
    dphi = random.choice([0.0, 180.0, 170.0, 60.0], 40)
    values = {"albedo": albedo, "sigma_deg": sigma_deg}
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    holds = MODELS[name].validity(geometry, **values).mask
    inside = Geometry.from_degrees(theta_i=theta_i[holds], theta_r=theta_r[holds], dphi=dphi[holds])
    assert exact_to(name, inside, values) <= VALID


@pytest.mark.parametrize(
    ("name", "theta_i", "theta_r"),
    [("oren_nayar", 75.0, -75.0), ("oren_nayar_qualitative", 60.0, -60.0)],
)
def test_where_a_form_fails_validity_says_so_and_another_method_is_taken(
    name: str, theta_i: float, theta_r: float
) -> None:
    there = Geometry.from_degrees(theta_i=[theta_i], theta_r=[theta_r])
    values = {"albedo": 0.01, "sigma_deg": 30.0}
    assert exact_to(name, there, values) > VALID
    validity = MODELS[name].validity(there, **values)
    assert not validity.mask.any()
    assert "off the integral" in validity.reason
    ranges = {parameter: (value, value) for parameter, value in values.items()}
    method = name.removeprefix("oren_nayar_").replace("oren_nayar", "functional")
    assert cheapest(ROUGH_SURFACE, there, ranges, VALID, among=[method]).method == "fine"


def test_what_is_not_mapped_is_said() -> None:
    grazing = Geometry.from_degrees(theta_i=[84.0, 86.0], theta_r=10.0)
    validity = MODELS["oren_nayar"].validity(grazing, albedo=0.5, sigma_deg=5.0)
    assert list(validity.mask) == [True, False]
    assert "not mapped" in validity.reason
    # A plane has one law, whatever the form.
    assert MODELS["oren_nayar"].validity(grazing, albedo=0.5, sigma_deg=0.0).mask.all()


def oblique(u: float) -> Measurements:
    """The integral at oblique angles, with so large a relative u, and no noise."""
    theta_r = np.linspace(-75, 75, 13)
    theta_i = np.repeat([60.0, 75.0], theta_r.size)
    views = np.tile(theta_r, 2)
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=views)
    f = MODELS["oren_nayar_exact"].brdf(geometry, albedo=0.8, sigma_deg=25.0)
    return Measurements.bare(theta_i, views, 0.0, f, u * f)


def test_the_fit_integrates_where_the_form_is_off_by_more_than_the_data_and_only_there() -> None:
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
def test_a_method_that_is_asked_for_is_the_only_one(method: str, own: str) -> None:
    found = choose(oblique(0.5), method=method)
    rough = {term for c in found.candidates for term in c.model.split("+")}
    assert rough & {*FORMS, "oren_nayar_exact"} == {own}


def test_a_protocol_names_the_method_or_the_models() -> None:
    assert FitConfig().method == SimulatedSample(model="lambert", parameters={}).method == "auto"
    assert FitConfig(method="exact").models is None
    with pytest.raises(ValidationError, match="method: exact; allowed: auto, as `models` names"):
        FitConfig(method="exact", models=["lambert"])


# What a sweep can tell.

VALUES = {"albedo": 0.8, "sigma_deg": 20.0}


def noisy(geometry: Geometry, seed: int) -> Measurements:
    f = MODELS["oren_nayar"].brdf(geometry, **VALUES).ravel()
    noise = np.random.default_rng(seed).standard_normal(f.size)
    return Measurements.bare(
        geometry.theta_i_deg.ravel(), geometry.theta_r_deg.ravel(), geometry.dphi_deg.ravel(),
        f * (1 + 0.01 * noise), 0.01 * f,
    )  # fmt: skip


@settings(max_examples=10)
@given(
    largest_deg=st.floats(10, 80), theta_i=st.floats(0, 70), plane=st.sampled_from([0.0, 90.0]),
    seed=st.integers(0, 999),
)  # fmt: skip
def test_a_fit_says_what_its_condition_foretells(
    largest_deg: float, theta_i: float, plane: float, seed: int
) -> None:
    """1 % points: four times below LIMIT both parameters have a u, four times above one has none.

    At four times LIMIT the worst combination is uncertain by a whole domain.
    """
    geometry = sweep([theta_i], largest_deg, plane)
    found = condition("oren_nayar", geometry, VALUES)
    result = fit(MODELS["oren_nayar"], noisy(geometry, seed))
    if found < LIMIT / 4:
        assert not result.undetermined
    if found > 4 * LIMIT:
        assert None in result.u.values()


def test_the_condition_of_hand_made_sweeps() -> None:
    """Under a normal lamp (33) is level: any sigma is an albedo. In plane it is not."""
    assert condition("oren_nayar", sweep([0.0], 60, 0.0), VALUES) > 20 * LIMIT
    assert condition("oren_nayar", sweep([45.0], 60, 0.0), VALUES) < LIMIT / 4
    one = Geometry.from_degrees(theta_i=[30.0], theta_r=[10.0])
    assert condition("oren_nayar", one, VALUES) == np.inf
    plane = {"albedo": 0.8, "sigma_deg": 0.0}  # nothing changes with sigma there, to first order
    assert condition("oren_nayar", sweep([45.0], 60, 0.0), plane) == np.inf
    sigmas, ends = np.array([5.0, 30.0]), np.array([10.0, 40.0, 70.0])
    found = condition_map("oren_nayar", {"albedo": 0.8}, [30.0], 0.0, sigmas, ends)
    assert found.shape == (2, 3)
    assert np.all(np.diff(found, axis=1) < 0)  # the wider the sweep, the better


# The window.


def test_where_the_window_dies_it_is_said() -> None:
    from acquisition.benchmark.maps.window_map import CAMERAS, TOLERABLE, pixels_and_bias

    for camera in CAMERAS:
        rig = load_protocol(
            CONFIGS / "protocols/demo.yaml", CONFIGS / "rigs" / f"{camera.name}.yaml"
        ).rig
        assert Pinhole.of(rig) == camera.pinhole
        for side_mm in (5.0, 20.0):
            for theta_r in (0.0, 60.0, 80.0, 88.0):
                pixels, bias = pixels_and_bias(camera.pinhole, theta_r, side_mm)
                expected = window_at(0.0, camera.pinhole, side_mm, side_mm).pixels
                # As the cosine, but for the perspective.
                shrunk = expected * np.cos(np.radians(theta_r))
                assert pixels == pytest.approx(shrunk, rel=0.01)
                assert abs(bias) < TOLERABLE


# Pictures of the scene.


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
def test_what_is_rendered_is_near_enough(name: str, values: dict[str, float]) -> None:
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
def test_models_without_a_cheaper_method_are_rendered_to_the_bit(name: str) -> None:
    there = Geometry.from_degrees(theta_i=30.0, theta_r=np.linspace(-80, 80, 33))
    values = {p.name: p.default for p in MODELS[name].parameters}
    found, as_before = adequate_brdf(name, values)(there), MODELS[name].brdf(there, **values)
    assert found.tobytes() == as_before.tobytes()
