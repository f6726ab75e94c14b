"""Patch for the calibration: the evenly lit part of the picture, or a word about the surface."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.calibration import patch
from acquisition.calibration.patch import patch_of
from analysis.calibration.pixel_maps import Stack
from instrument.errors import NotDetermined

SHAPE = (60, 80)
NO_HOT = np.zeros(SHAPE, dtype=bool)


def stack(mean: np.ndarray) -> Stack:
    return Stack(exposure_s=0.1, mean_dn=mean, variance_dn2=np.ones(SHAPE), frames=4)


def test_the_even_part_is_taken_for_levels_and_the_lit_part_for_the_flat_field() -> None:
    fall = np.linspace(1.0, 0.2, SHAPE[1]) * np.ones(SHAPE)
    hot = NO_HOT.copy()
    hot[10, 5] = True
    found = patch_of(stack(64 + 2000 * fall), 64.0, hot)
    columns = np.flatnonzero(found.level[30])
    assert (columns.min(), fall[30, columns.max()]) == (0, pytest.approx(0.88, abs=0.03))
    assert fall[30, np.flatnonzero(found.lit[30]).max()] == pytest.approx(0.49, abs=0.03)
    assert not found.level[10, 5]
    assert found.pixels == np.count_nonzero(found.level)


def test_of_many_pixels_a_regular_choice_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(patch, "_MOST_PIXELS", 1000)
    found = patch.patch_of(stack(np.full(SHAPE, 2000.0)), 64.0, NO_HOT)
    assert 900 < found.pixels <= 1000
    assert np.all(found.level.any(axis=1))
    assert np.all(found.lit)


def test_a_surface_that_is_too_small_is_told() -> None:
    light = np.zeros(SHAPE)
    light[20:40, 30:50] = 2000.0
    with pytest.raises(NotDetermined, match=r"fills [\d.]+ % of the picture.*larger surface"):
        patch_of(stack(64 + light), 64.0, NO_HOT)
