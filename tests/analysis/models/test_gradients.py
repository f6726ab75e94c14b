"""Gradients of every model and sum, against differences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from analysis.models import MODELS
from instrument.geometry import FloatArray
from tests.support.models.geometries import (
    parameters_at,
    random_directions,
)
from tests.support.models.names import NAMES


@pytest.mark.parametrize("part", [0.02, 0.3, 0.7, 0.98])
@pytest.mark.parametrize("name", NAMES)
def test_the_gradient_is_that_of_central_differences(name: str, part: float) -> None:
    model, geometry = MODELS[name], random_directions(60)
    values = parameters_at(model, part)
    found = model.gradient(geometry, **values)
    expected = replace(model, gradient_kernel=None).gradient(geometry, **values)
    assert list(found) == [p.name for p in model.parameters]
    for key, slope in found.items():
        assert slope.shape == geometry.shape
        scale = np.max(np.abs(expected[key]), initial=1e-30)
        np.testing.assert_allclose(slope, expected[key], rtol=2e-5, atol=5e-6 * scale)


@pytest.mark.parametrize("name", NAMES)
def test_the_gradient_on_the_bounds_is_finite(name: str) -> None:
    model, geometry = MODELS[name], random_directions(20)
    for part in (0.0, 1.0):
        for slope in model.gradient(geometry, **parameters_at(model, part)).values():
            assert np.all(np.isfinite(slope))


def difference(f: Callable[[float], FloatArray], x: float, step: float) -> FloatArray:
    """One-sided derivative of fourth order; `step` of either sign."""
    f0, f1, f2, f3, f4 = (f(x + k * step) for k in range(5))
    return (-25 * f0 + 48 * f1 - 36 * f2 + 16 * f3 - 3 * f4) / (12 * step)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("part", [0.0, 1.0])
def test_the_gradient_on_a_bound_is_the_one_sided_derivative(name: str, part: float) -> None:
    model, geometry = MODELS[name], random_directions(30, 80.0)
    values = parameters_at(model, part)
    found = model.gradient(geometry, **values)
    for p in model.parameters:
        if p.name == "single_scattering_albedo" and part == 1:
            continue  # without limit there, as 1/sqrt(1 - rho)

        def along(x: float, name: str = p.name) -> FloatArray:
            return model.brdf(geometry, **{**values, name: x})

        step = (1 - 2 * part) * (p.high - p.low)
        either = [difference(along, values[p.name], step * h) for h in (1e-5, 1e-3)]
        scale = np.max(np.abs(either)) + 1e-12
        rounding = 1e-15 * np.max(np.abs(along(values[p.name]))) / abs(1e-5 * step)
        error = np.min(np.abs(np.array(either) - found[p.name]), axis=0)
        assert np.all(error <= 2e-5 * scale + rounding), p.name
