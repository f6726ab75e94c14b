"""Uniformity of the light: known maps are recovered, and a tile that is not seen is refused."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.calibration.uniformity import Cells, cells_of, fit_uniformity, irradiance
from instrument.errors import NotDetermined
from instrument.geometry import FloatArray, lamp_direction

SIDE = 45.0


def pixels(step_mm: float = 0.4) -> FloatArray:
    along = np.arange(-30, 30, step_mm)
    return np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)


def cells(light: FloatArray, points: FloatArray) -> Cells:
    return cells_of(points, light, np.ones(len(points), dtype=bool), SIDE)


def test_random_maps_are_recovered_within_their_u() -> None:
    rng, points, pulls = np.random.default_rng(5), pixels(0.8), []
    x, y = points.T / (SIDE / 2)
    truth_at = np.linspace(-10, 10, 33)
    xs, ys = (grid.ravel() for grid in np.meshgrid(truth_at, truth_at))
    for _ in range(25):
        a, b, c, d, e = rng.normal(0, 0.03, 5)
        level = rng.uniform(100, 3000)
        light = level * (1 + a * x + b * y + c * x**2 + d * x * y + e * y**2)
        fit = fit_uniformity(cells(light * (1 + 0.01 * rng.standard_normal(x.size)), points))
        u, v = xs / (SIDE / 2), ys / (SIDE / 2)
        true = 1 + a * u + b * v + c * u**2 + d * u * v + e * v**2
        found = fit.peak_to_valley(20.0)
        assert np.abs(fit.light(xs, ys) - true).max() < 0.005
        pulls.append((found.value - np.ptp(true)) / found.u)
    assert np.abs(pulls).max() < 4
    assert 0.5 < np.std(pulls) < 1.5


def test_noise_takes_the_lowest_order_and_shows_no_more_than_its_u() -> None:
    rng, points = np.random.default_rng(6), pixels()
    fit = fit_uniformity(cells(1000 + rng.standard_normal(len(points)), points))
    found = fit.peak_to_valley(20.0)
    assert fit.order == 1
    assert found.value < 4 * found.u < 1e-3


def test_the_irradiance_is_the_cosine_over_the_distance_squared() -> None:
    points, theta_i = np.array([[0.0, 0.0], [12.0, -5.0], [-20.0, 8.0]]), 35.0
    source = 900 * lamp_direction(theta_i, 0.0)
    apart = source - np.column_stack([points, np.zeros(3)])
    distance = np.linalg.norm(apart, axis=1)
    expected = apart[:, 2] / distance / distance**2
    assert irradiance(points, theta_i, 0.0, 900.0) == pytest.approx(expected / expected[0])


def test_a_tile_that_the_picture_hardly_shows_is_refused() -> None:
    points = pixels()
    seen = points[points[:, 0] > 5]
    with pytest.raises(NotDetermined, match=r"shows 3\d % of the tile's square of 45 mm"):
        cells(np.ones(len(seen)), seen)


def test_the_u_covers_beams_that_are_no_polynomial() -> None:
    rng, points, pulls = np.random.default_rng(8), pixels(0.8), []
    grid = np.stack(np.meshgrid(*2 * [np.linspace(-10, 10, 33)]), axis=-1).reshape(-1, 2)
    for _ in range(25):
        aim, fwhm_mm = rng.normal(0, 4, 2), rng.uniform(70, 200)

        def beam(at: FloatArray, aim: FloatArray = aim, fwhm: float = fwhm_mm) -> FloatArray:
            return np.asarray(np.exp2(-4 * ((at - aim) ** 2).sum(axis=1) / fwhm**2))

        light = beam(points) * (1 + 0.01 * rng.standard_normal(len(points)))
        found = fit_uniformity(cells(light, points)).peak_to_valley(20.0)
        true = np.ptp(beam(grid)) / beam(np.zeros((1, 2)))[0]
        assert found.value == pytest.approx(true, rel=0.05, abs=1e-3)
        pulls.append((found.value - true) / found.u)
    assert np.sqrt(np.mean(np.square(pulls))) < 1.6
