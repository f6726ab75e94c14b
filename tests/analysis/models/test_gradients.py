"""What every model owes: derivatives, numbers on the closed domain, and a word where it ends."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from analysis.models import MODELS, Model
from analysis.models.rough.oren_nayar import oren_nayar_qualitative_validity
from analysis.models.rough.oren_nayar_forms import (
    oren_nayar_qualitative_brdf,
    oren_nayar_qualitative_gradient,
)
from instrument.geometry import Geometry

NAMES = list(MODELS)
# Wolff's K depends on theta_r alone: see test_models_wolff.py for how far it is from reciprocal.
RECIPROCAL = [name for name in NAMES if name != "wolff"]
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


def at(model: Model, part: float) -> dict[str, float]:
    """Parameters at that part of their domains."""
    return {p.name: p.low + part * (p.high - p.low) for p in model.parameters}


def scattered(count: int, most: float = 85.0) -> Geometry:
    rng = np.random.default_rng(20)
    i, r, p = rng.random((3, count))
    return Geometry.from_degrees(theta_i=most * i, theta_r=most * r, dphi=360 * p)


@pytest.mark.parametrize("part", [0.02, 0.3, 0.7, 0.98])
@pytest.mark.parametrize("name", NAMES)
def test_the_gradient_is_that_of_central_differences(name: str, part: float) -> None:
    model, geometry = MODELS[name], scattered(60)
    values = at(model, part)
    found = model.gradient(geometry, **values)
    expected = replace(model, gradient_kernel=None).gradient(geometry, **values)
    assert list(found) == [p.name for p in model.parameters]
    for key, slope in found.items():
        assert slope.shape == geometry.shape
        scale = np.max(np.abs(expected[key]), initial=1e-30)
        np.testing.assert_allclose(slope, expected[key], rtol=2e-5, atol=5e-6 * scale)


@pytest.mark.parametrize("name", NAMES)
def test_the_gradient_on_the_bounds_is_of_numbers(name: str) -> None:
    model, geometry = MODELS[name], scattered(20)
    for part in (0.0, 1.0):
        for slope in model.gradient(geometry, **at(model, part)).values():
            assert np.all(np.isfinite(slope))


def test_wolff_s_slope_by_albedo_near_1_by_small_steps() -> None:
    # It grows as 1/sqrt(1 - rho), so that the base class's step is too long there.
    geometry, rho, step = scattered(20), 1 - 1e-5, 1e-8
    model = MODELS["wolff"]
    up, down = (
        model.brdf(geometry, single_scattering_albedo=rho + d, n=1.5) for d in (step, -step)
    )
    found = model.gradient(geometry, single_scattering_albedo=rho, n=1.5)
    np.testing.assert_allclose(
        found["single_scattering_albedo"], (up - down) / (2 * step), rtol=1e-5
    )


ANGLES = [0.0, 1e-9, 15.0, 45.0, 60.0, 80.0, 89.0, 89.99, 90.0]
CLOSED = Geometry.from_degrees(
    theta_i=np.array(ANGLES)[:, np.newaxis, np.newaxis],
    theta_r=np.array(ANGLES)[:, np.newaxis],
    dphi=[0.0, 1e-9, 60.0, 90.0, 120.0, 180.0],
)


GRAZING = np.maximum(CLOSED.theta_i_deg, CLOSED.theta_r_deg) == 90


@pytest.mark.parametrize("name", NAMES)
def test_the_closed_domain_gives_reflectances_or_says_why_not(name: str) -> None:
    model = MODELS[name]
    sides = [(p.low, p.default, p.high) for p in model.parameters]
    for point in product(*sides):
        values = dict(zip((p.name for p in model.parameters), point, strict=True))
        with np.errstate(invalid="raise", divide="raise"):
            brdf, validity = model.brdf(CLOSED, **values), model.validity(CLOSED, **values)
        assert validity.mask.shape == brdf.shape == CLOSED.shape
        assert validity.mask.dtype == bool
        assert bool(validity.reason) == (not validity.mask.all())
        # At 90 degrees, where 1/cos is 1.6e16 by rounding, a large value stands for no limit.
        wrong = ~np.isfinite(brdf) | (brdf < 0) | ((brdf > 1e13) & GRAZING)
        assert not np.any(wrong & validity.mask), (values, np.argwhere(wrong & validity.mask)[:3])


@pytest.mark.parametrize("name", RECIPROCAL)
def test_reciprocity(name: str) -> None:
    there = scattered(40)
    back = Geometry.from_degrees(
        theta_i=there.theta_r_deg, theta_r=there.theta_i_deg, dphi=-there.dphi_deg
    )
    for part in (0.0, 0.3, 1.0):
        values = at(MODELS[name], part)
        np.testing.assert_allclose(
            MODELS[name].brdf(there, **values), MODELS[name].brdf(back, **values), rtol=1e-9
        )


@pytest.mark.parametrize("name", CONSERVING)
def test_no_more_is_reflected_than_received(name: str) -> None:
    t, w = np.polynomial.legendre.leggauss(60)
    theta, weight = np.pi / 4 * (t + 1), np.pi / 4 * w
    for theta_i in (0.0, 40.0, 70.0):
        geometry = Geometry.from_degrees(
            theta_i=theta_i, theta_r=np.degrees(theta)[:, np.newaxis], dphi=np.arange(1.0, 361, 2)
        )
        mean = MODELS[name].brdf(geometry, **CONSERVING[name]).mean(axis=1)
        assert 2 * np.pi * mean @ (weight * np.sin(theta) * np.cos(theta)) <= 1 + 1e-3


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
    assert model.brdf(one, **values) == pytest.approx(
        model.brdf(grid, **values)[1, 1, 1], rel=1e-13
    )


def test_footnote_11_s_constant() -> None:
    # 1995, footnote 11: 0.57 for 0.33 in A partly makes up for interreflection: brighter
    geometry = scattered(30)
    sigma2 = math.radians(30.0) ** 2
    usual = oren_nayar_qualitative_brdf(geometry, 0.9, 30.0)
    brighter = oren_nayar_qualitative_brdf(geometry, 0.9, 30.0, constant=0.57)
    expected = 0.9 / np.pi * 0.5 * sigma2 * (1 / (sigma2 + 0.33) - 1 / (sigma2 + 0.57))
    np.testing.assert_allclose(brighter - usual, expected, rtol=1e-12)
    step = 1e-5
    up, down = (oren_nayar_qualitative_brdf(geometry, 0.9, 30 + d, 0.57) for d in (step, -step))
    slopes = oren_nayar_qualitative_gradient(geometry, 0.9, 30.0, constant=0.57)
    np.testing.assert_allclose(slopes["sigma_deg"], (up - down) / (2 * step), rtol=1e-6, atol=1e-10)
    assert oren_nayar_qualitative_validity(geometry, 0.9, 5.0, constant=0.57).mask.any()


def test_where_the_functional_model_ends() -> None:
    # errata: negative far forward, at 45 degrees from 84/84 and at 60 degrees from 77/77 on
    model = MODELS["oren_nayar"]
    for sigma_deg, from_deg in ((45.0, 84), (60.0, 77)):
        geometry = Geometry.from_degrees(
            theta_i=[from_deg - 1, from_deg], theta_r=[1 - from_deg, -from_deg]
        )
        validity = model.validity(geometry, albedo=1e-6, sigma_deg=sigma_deg)
        assert not validity.mask.any()  # a degree earlier it is far off the integral already
        assert "negative" in validity.reason
        assert "off the integral" in validity.reason
        assert list(model.brdf(geometry, albedo=1e-6, sigma_deg=sigma_deg) >= 0) == [True, False]
    grazing = Geometry.from_degrees(theta_i=90, theta_r=[89, 90])
    assert not model.validity(grazing, albedo=0.5, sigma_deg=30).mask.any()
    assert model.validity(grazing, albedo=0.5, sigma_deg=0).mask.all()


def test_where_the_qualitative_model_ends() -> None:
    # errata: sigma 30 degrees, 75/60 opposite sides: 0.773 for an integral of 0.355
    model = MODELS["oren_nayar_qualitative"]
    geometry = Geometry.from_degrees(theta_i=75, theta_r=[-60, 0, 60])
    validity = model.validity(geometry, albedo=0.5, sigma_deg=30)
    assert list(validity.mask) == [False, True, True]
    assert "forward" in validity.reason
    assert model.validity(geometry, albedo=0.5, sigma_deg=5).mask.all()
