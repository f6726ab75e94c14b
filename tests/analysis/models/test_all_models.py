"""Promises of every model and sum: reciprocity, energy, finite numbers, validity, smoothness."""

from __future__ import annotations

import warnings
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.models import MODELS, Model
from instrument.geometry import Geometry
from tests.support.models.geometries import (
    exchanged,
    extreme_directions,
    extreme_parameters,
    parameters_at,
    random_directions,
)
from tests.support.models.names import NAMES
from tests.support.models.reflectance import hemispherical_reflectance

ANGLE = st.floats(0.0, 88.0)
AZIMUTH = st.floats(0.0, 360.0)
PART = st.floats(0.0, 1.0)
# Wolff's K depends on theta_r alone (1998, equation (8)): its own tests state the deviation.
RECIPROCAL = [name for name in NAMES if "wolff" not in name.split("+")]

# Reflect no more than they receive, whatever their parameters.
CONSERVING = {
    "lambert": {"albedo": 1.0},
    "minnaert": {"albedo": 1.0, "k": 1.5},
    "torrance_sparrow_lobe": {"ks": 1.0, "lobe_sigma_deg": 30.0},
    "eon": {"albedo": 1.0, "roughness": 1.0},
    "ggx": {"f0": 1.0, "alpha": 0.5},
    "ggx_f90": {"f0": 1.0, "f90": 1.0, "alpha": 0.5},
    "single_scattering": {"scattering": 1.0, "asymmetry": 0.5},
    "wolff": {"single_scattering_albedo": 1.0, "n": 1.5},
}

NEGATIVE_AS_PRINTED = (
    "oren_nayar",
    "oren_nayar_weighted",
    "oren_nayar+torrance_sparrow",
    "wolff_oren_nayar",
    "wolff_oren_nayar+ggx",
)


def inside(model: Model, part: float) -> dict[str, float]:
    """Parameters at that part of their domain (of ks only the first tenth is physical)."""
    return {
        p.name: p.low + part * (p.high - p.low) * (0.1 if p.name == "ks" else 1.0)
        for p in model.parameters
    }


@pytest.mark.parametrize("name", RECIPROCAL)
@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, part=PART)
def test_reciprocity_at_random_parameters(
    name: str, theta_i: float, theta_r: float, dphi: float, part: float
) -> None:
    model = MODELS[name]
    there = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    back = exchanged(there)
    values = inside(model, part)
    np.testing.assert_allclose(
        model.brdf(there, **values), model.brdf(back, **values), rtol=1e-9, atol=1e-12
    )


@pytest.mark.parametrize("name", RECIPROCAL)
def test_reciprocity_at_the_bounds(name: str) -> None:
    there = random_directions(40)
    back = exchanged(there)
    for part in (0.0, 0.3, 1.0):
        values = parameters_at(MODELS[name], part)
        np.testing.assert_allclose(
            MODELS[name].brdf(there, **values), MODELS[name].brdf(back, **values), rtol=1e-9
        )


@pytest.mark.parametrize("name", CONSERVING)
def test_no_more_is_reflected_than_received(name: str) -> None:
    for theta_i in (0.0, 40.0, 70.0):
        found = hemispherical_reflectance(name, theta_i, **CONSERVING[name])
        assert found <= 1 + 1e-3


@pytest.mark.parametrize("name", ["lambert", "oren_nayar_qualitative", "torrance_sparrow"])
@given(theta_i=ANGLE, theta_r=ANGLE, dphi=AZIMUTH, part=PART)
def test_never_negative_where_promised(
    name: str, theta_i: float, theta_r: float, dphi: float, part: float
) -> None:
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    assert MODELS[name].brdf(geometry, **inside(MODELS[name], part)) >= 0


@pytest.mark.parametrize("name", NAMES)
def test_grazing_directions_are_finite(name: str) -> None:
    geometry = Geometry.from_degrees(
        theta_i=[[0.0], [45.0], [90.0]], theta_r=[-90.0, -45.0, 0.0, 45.0, 90.0]
    )
    values = {p.name: p.default for p in MODELS[name].parameters}
    with np.errstate(all="raise"):
        assert np.all(np.isfinite(MODELS[name].brdf(geometry, **values)))


ANGLES = [0.0, 1e-9, 15.0, 45.0, 60.0, 80.0, 89.0, 89.99, 90.0]

CLOSED = Geometry.from_degrees(
    theta_i=np.array(ANGLES)[:, np.newaxis, np.newaxis],
    theta_r=np.array(ANGLES)[:, np.newaxis],
    dphi=[0.0, 1e-9, 60.0, 90.0, 120.0, 180.0],
)

GRAZING = np.maximum(CLOSED.theta_i_deg, CLOSED.theta_r_deg) == 90


@pytest.mark.parametrize("name", MODELS)
def test_the_closed_domain_is_finite_and_not_negative_where_valid(name: str) -> None:
    model = MODELS[name]
    sides = [(p.low, p.default, p.high) for p in model.parameters]
    for point in product(*sides):
        values = dict(zip((p.name for p in model.parameters), point, strict=True))
        with np.errstate(invalid="raise", divide="raise"):
            brdf, validity = model.brdf(CLOSED, **values), model.validity(CLOSED, **values)
        assert validity.mask.shape == brdf.shape == CLOSED.shape
        assert validity.mask.dtype == bool
        assert bool(validity.reason) == (not validity.mask.all())
        # At 90 degrees, where 1/cos is 1.6e16 by rounding, a large value stands for divergence.
        wrong = ~np.isfinite(brdf) | (brdf < 0) | ((brdf > 1e13) & GRAZING)
        assert not np.any(wrong & validity.mask), (values, np.argwhere(wrong & validity.mask)[:3])


@pytest.mark.parametrize("name", NAMES)
def test_no_warning_no_nan_and_nothing_negative_at_extreme_arguments(name: str) -> None:
    random, model = np.random.default_rng(22), MODELS[name]
    for _ in range(25):
        geometry, values = extreme_directions(random, 120), extreme_parameters(random, model)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            brdf, validity = model.brdf(geometry, **values), model.validity(geometry, **values)
            gradient = model.gradient(geometry, **values)
        assert np.all(np.isfinite(brdf)), values
        assert all(np.all(np.isfinite(slope)) for slope in gradient.values()), values
        negative = brdf < 0
        assert not np.any(negative & validity.mask), values
        assert name in NEGATIVE_AS_PRINTED or not np.any(negative), values


@pytest.mark.parametrize("name", NAMES)
def test_the_brdf_is_smooth_in_its_parameters(name: str) -> None:
    """Fourth differences fall as the fourth power of the step: no kink, no noise."""
    model, geometry = MODELS[name], random_directions(20)
    values = parameters_at(model, 0.45)
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


@pytest.mark.parametrize("name", NAMES)
def test_shapes_broadcast_and_numbers_are_float64(name: str) -> None:
    model = MODELS[name]
    values = {p.name: p.default for p in model.parameters}
    grid = Geometry.from_degrees(
        theta_i=np.array([[[10.0]], [[50.0]]]), theta_r=np.array([[0.0], [40.0], [-70.0]]),
        dphi=np.array([0, 45, 90, 180], dtype=np.int32),
    )  # fmt: skip
    empty = Geometry.from_degrees(theta_i=np.empty((0, 3)), theta_r=10.0)
    for geometry, shape in ((grid, (2, 3, 4)), (empty, (0, 3))):
        found = model.brdf(geometry, **values)
        assert found.shape == shape
        assert found.dtype == np.float64
        assert model.validity(geometry, **values).mask.shape == shape
        assert all(s.shape == shape for s in model.gradient(geometry, **values).values())
    one = Geometry.from_degrees(theta_i=50, theta_r=40, dphi=45)
    assert model.brdf(one, **values).shape == ()
    assert model.brdf(one, **values) == pytest.approx(
        model.brdf(grid, **values)[1, 1, 1], rel=1e-13
    )
