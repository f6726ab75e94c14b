"""Statistics of frames agree with NumPy's, and leave out what a whole frame has in common."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.calibration.frame_statistics import level_of, series_of, stack_of, table_of
from instrument.devices import Frame


def frames(count: int = 5, exposure_s: float = 0.1, common: float = 0.0) -> list[Frame]:
    rng = np.random.default_rng(4)
    level = 50_000 + common * rng.standard_normal(count)
    return [
        Frame(np.rint(level[n] + 40 * rng.standard_normal((30, 40))).astype(np.uint16), exposure_s,
              10.0 + n)
        for n in range(count)
    ]  # fmt: skip


def test_mean_and_variance_of_each_pixel_are_exact() -> None:
    taken = frames()
    whole = np.stack([frame.image for frame in taken]).astype(np.float64)
    stack = stack_of(taken)
    assert stack.mean_dn == pytest.approx(whole.mean(axis=0), rel=1e-14)
    assert stack.variance_dn2 == pytest.approx(whole.var(axis=0, ddof=1), rel=1e-12)
    assert (stack.exposure_s, stack.frames) == (0.1, 5)


def test_counts_are_made_linear_before_they_are_averaged() -> None:
    def linear(counts: NDArray[Any]) -> NDArray[Any]:
        return np.sqrt(counts.astype(np.float64))

    taken, patch = frames(), np.ones((30, 40), dtype=bool)
    whole = np.stack([linear(frame.image) for frame in taken])
    assert stack_of(taken, linear).mean_dn == pytest.approx(whole.mean(axis=0), rel=1e-14)
    assert level_of(taken, patch, 0.0, linear)[1] == pytest.approx(whole.mean(), rel=1e-14)


def test_flicker_of_whole_frames_is_no_noise_of_pixels() -> None:
    patch = np.zeros((30, 40), dtype=bool)
    patch[5:25, 5:35] = True
    exposure_s, mean, variance, scatter, count, age_s = level_of(frames(8, 0.1, 500), patch, 9.0)
    assert (exposure_s, count, age_s) == (0.1, 8.0, 4.5)
    assert mean == pytest.approx(50_000, abs=600)
    assert variance == pytest.approx(1600, rel=0.1)
    assert scatter == pytest.approx(500**2, rel=0.9)


def test_levels_are_sorted_by_exposure_and_an_exposure_counts_once() -> None:
    patch = np.ones((30, 40), dtype=bool)
    levels = [level_of(frames(2, e), patch, 10.0) for e in (0.3, 0.1, 0.2, 0.1)]
    series = series_of(levels, 1200)
    assert series.exposure_s.tolist() == [0.1, 0.2, 0.3]
    assert table_of(series).shape == (3, 6)
    assert table_of(series)[:, 0].tolist() == [0.1, 0.2, 0.3]
