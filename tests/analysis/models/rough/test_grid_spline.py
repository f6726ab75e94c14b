"""Cubic spline on a grid: exact for cubics and at the nodes, and the one that SciPy makes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import NdBSpline, make_interp_spline

from analysis.models.rough.grid_spline import GridSpline
from instrument.geometry import FloatArray

AXES = (np.linspace(0, 1, 9) ** 2, np.array([-1.0, 0.0, 0.3, 0.9, 2.0]), np.linspace(3, 4, 6))
POINTS = tuple(
    x[0] + (x[-1] - x[0]) * np.random.default_rng(n).uniform(size=200) for n, x in enumerate(AXES)
)


def cubic(x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
    """Two cubic polynomials, in the last axis of the result."""
    return np.stack([x**3 * y - z**2 * y**3 + 1, 2 * x * y**2 * z**3 - x], axis=-1)


def test_a_cubic_is_reproduced() -> None:
    spline = GridSpline.through(AXES, cubic(*np.meshgrid(*AXES, indexing="ij")))
    np.testing.assert_allclose(spline.at(*POINTS).T, cubic(*POINTS), rtol=1e-10, atol=1e-10)


def test_it_passes_through_every_value() -> None:
    values = np.random.default_rng(7).normal(size=(9, 5, 6, 1))
    nodes = [x.ravel() for x in np.meshgrid(*AXES, indexing="ij")]
    found = GridSpline.through(AXES, values).at(*nodes)
    np.testing.assert_allclose(found[0], values.ravel(), rtol=1e-11, atol=1e-11)


def test_it_is_the_spline_of_scipy() -> None:
    values, knots = np.random.default_rng(8).normal(size=(9, 5, 6, 2)), []
    coefficients = values
    for axis, nodes in enumerate(AXES):
        one = make_interp_spline(nodes, coefficients, k=3, axis=axis)
        knots.append(one.t)
        coefficients = np.moveaxis(one.c, 0, axis)
    expected = NdBSpline(tuple(knots), coefficients, 3)(np.stack(POINTS, axis=-1))
    found = GridSpline.through(AXES, values).at(*POINTS)
    np.testing.assert_allclose(found.T, expected, rtol=1e-10, atol=1e-10)


def test_the_first_axis_can_be_fixed() -> None:
    spline = GridSpline.through(AXES, cubic(*np.meshgrid(*AXES, indexing="ij")))
    fixed = spline.at_first(0.37).at(*POINTS[1:])
    whole = spline.at(np.full(200, 0.37), *POINTS[1:])
    np.testing.assert_allclose(fixed, whole, rtol=1e-13)


@pytest.mark.parametrize("x", [(-0.01, 0.0, 3.5), (0.5, 2.1, 3.5), (0.5, 0.0, 4.1)])
def test_there_is_no_value_outside_the_grid(x: tuple[float, float, float]) -> None:
    spline = GridSpline.through(AXES, cubic(*np.meshgrid(*AXES, indexing="ij")))
    assert np.all(np.isnan(spline.at(*(np.array([value]) for value in x))))
    assert np.all(np.isnan(spline.at_first(x[0]).at(*(np.array([value]) for value in x[1:]))))
