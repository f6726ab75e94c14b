"""Statistics of frames of one exposure: of each pixel, and of a patch of pixels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.calibration.level_series import LevelSeries
from analysis.calibration.pixel_maps import Stack
from instrument.devices import Frame
from instrument.geometry import BoolArray, FloatArray

Level = tuple[float, float, float, float, float, float]
Linear = Callable[[NDArray[Any]], NDArray[Any]]


def as_counted(counts: NDArray[Any]) -> NDArray[Any]:
    """Return counts in DN, of any shape, as the camera gave them."""
    return counts


def stack_of(frames: Sequence[Frame], linear: Linear = as_counted) -> Stack:
    """Return mean and variance of each pixel, summed up frame by frame; exact for whole counts.

    linear: makes counts linear in light.
    """
    shape = frames[0].image.shape
    total, squares = np.zeros(shape), np.zeros(shape)
    for frame in frames:
        counts = linear(frame.image).astype(np.float64)
        total += counts
        squares += counts * counts
    count = len(frames)
    spread = (count * squares - total * total) / (count * (count - 1))
    return Stack(
        exposure_s=frames[0].exposure_s, mean_dn=total / count, variance_dn2=spread, frames=count
    )


def level_of(
    frames: Sequence[Frame], patch: BoolArray, start_s: float, linear: Linear = as_counted
) -> Level:
    """Return a row of a `LevelSeries` for the pixels of a patch (rows, columns).

    Counts in DN, times in s from `start_s` on. The variance is without what a frame has in common.
    linear: makes counts linear in light.
    """
    counts = np.stack([linear(frame.image[patch]) for frame in frames]).astype(np.float64)
    means = counts.mean(axis=1)
    own = (counts - means[:, None]).var(axis=0, ddof=1)
    middle_s = float(np.mean([frame.time_s for frame in frames]))
    return (
        frames[0].exposure_s, float(means.mean()), float(own.mean()),
        float(means.var(ddof=1)), float(len(frames)), middle_s - start_s,
    )  # fmt: skip


def series_of(levels: Sequence[Level], pixels: int) -> LevelSeries:
    """Return levels in the order of rising exposure, of equal exposures the first."""
    kept = {level[0]: level for level in reversed(levels)}
    return series_in_order([kept[exposure] for exposure in sorted(kept)], pixels)


def series_in_order(levels: Sequence[Level], pixels: int) -> LevelSeries:
    """Return levels in the order in which they are given."""
    columns: FloatArray = np.array(levels).T
    return LevelSeries(
        exposure_s=columns[0], mean_dn=columns[1], variance_dn2=columns[2],
        scatter_dn2=columns[3], frames=columns[4], age_s=columns[5], pixels=pixels,
    )  # fmt: skip


def table_of(levels: LevelSeries) -> FloatArray:
    """Return a series as a table (exposures, 6), in s, DN, DN squared, DN squared, 1 and s."""
    return np.stack(
        [
            levels.exposure_s, levels.mean_dn, levels.variance_dn2, levels.scatter_dn2,
            levels.frames, levels.age_s,
        ],
        axis=1,
    )  # fmt: skip
