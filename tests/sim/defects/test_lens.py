"""Lens that darkens and bends the picture, and scatters light."""

from __future__ import annotations

import numpy as np
import pytest

from instrument.config.simulated.defects import LensDefects
from sim.defects.lens import bent_by_lens, transmission, veiled
from sim.defects.picture import scattered
from sim.defects.world import SOUND, World

SHAPE = (101, 161)
HALF = np.hypot(*SHAPE) / 2
MIDDLE = (50, 80)


def test_a_sound_lens_changes_nothing() -> None:
    image = np.random.default_rng(1).random(SHAPE, dtype=np.float32)
    assert np.all(transmission(SHAPE, LensDefects()) == 1)
    assert bent_by_lens(image, LensDefects()) is image
    assert scattered(image, SOUND, LensDefects(), 5.0) is image


def test_vignetting_grows_with_the_square_of_the_distance_from_the_lens_axis() -> None:
    left = transmission(SHAPE, LensDefects(vignetting=0.1))
    assert left[MIDDLE] == 1.0
    assert 1 - left[50, 0] == pytest.approx(0.1 * (80 / HALF) ** 2, abs=1e-6)
    np.testing.assert_array_equal(left, left[::-1, ::-1])
    aside = transmission(SHAPE, LensDefects(vignetting=0.1, axis_column_px=20, axis_row_px=-10))
    assert np.unravel_index(np.argmax(aside), SHAPE) == (40, 100)


@pytest.mark.parametrize("distortion", [-0.05, 0.03])
def test_distortion_moves_a_point_by_its_share_of_the_distance(distortion: float) -> None:
    """The picture of the column numbers shows from which column each pixel has its light."""
    lens = LensDefects(distortion=distortion)
    columns = np.tile(np.arange(SHAPE[1], dtype=np.float32), (SHAPE[0], 1))
    from_column = bent_by_lens(columns, lens)
    assert from_column[MIDDLE] == 80.0
    for column in (60, 90, 110):
        away = column - 80
        move = (away - (from_column[50, column] - 80)) / (from_column[50, column] - 80)
        assert move == pytest.approx(distortion * (away / HALF) ** 2, abs=2e-5)
    np.testing.assert_allclose(from_column + from_column[:, ::-1], 160.0, atol=1e-3)


def test_scattered_light_is_not_lost_and_spreads_as_its_formula_says() -> None:
    """A point of light in the middle: what is missing has left the frame."""
    share, width = 0.2, 8.0
    point = np.zeros(SHAPE, np.float32)
    point[MIDDLE] = 1e4
    veil = veiled(point, share, width)
    assert veil[MIDDLE] == pytest.approx(0.8e4, rel=1e-2)
    for away in (12, 25, 45):
        expected = share * 1e4 * width / (2 * np.pi * (away**2 + width**2) ** 1.5)
        assert veil[50, 80 + away] == pytest.approx(expected, rel=0.05)
        assert veil[50, 80 - away] == pytest.approx(expected, rel=0.05)
    row, column = np.indices(SHAPE)
    density = width / (2 * np.pi * ((row - 50) ** 2 + (column - 80) ** 2 + width**2) ** 1.5)
    assert veil.sum() == pytest.approx(1e4 * (1 - share + share * density.sum()), rel=2e-3)


def test_a_wide_bright_field_stays_as_bright_and_veils_a_dark_patch() -> None:
    field = np.ones((300, 300), np.float32)
    even = veiled(field, 0.05, 6.0)
    assert even[150, 150] == pytest.approx(1.0, abs=0.05 * 0.06)
    field[140:160, 140:160] = 0.0
    patch = veiled(field, 0.05, 6.0)[150, 150]
    assert 0.4 * 0.05 < patch < 0.6 * 0.05  # half of the light comes from beyond sqrt(3) widths


def test_defocus_spreads_light_as_the_world_does_and_adds_to_it() -> None:
    light = np.zeros(SHAPE, np.float32)
    light[40:60, 70:90] = 100.0
    blurred = scattered(light, SOUND, LensDefects(defocus_px=3.0), 5.0)
    assert blurred.sum() == pytest.approx(light.sum(), rel=1e-5)
    np.testing.assert_array_equal(blurred, scattered(light, World(blur_mm=0.6), LensDefects(), 5.0))
    both = scattered(light, World(blur_mm=0.8), LensDefects(defocus_px=3.0), 5.0)
    np.testing.assert_array_equal(both, scattered(light, World(blur_mm=1.0), LensDefects(), 5.0))
