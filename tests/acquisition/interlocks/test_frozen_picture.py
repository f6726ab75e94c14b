"""Frozen picture: a repeated frame is refused where noise must have changed it, and only there."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from acquisition.interlocks.frozen_picture import FrozenPicture, differing_pixels
from instrument.devices import Frame
from instrument.errors import Interlock
from tests.support.synthetic_frames import RIGS, noisy_frames
from tests.support.timing.cpu_time import cpu_seconds

SHAPES = [(16, 24), (60, 70), (480, 640)]


def series(bits: int, level: float, count: int, shape: tuple[int, int], seed: int) -> list[Frame]:
    random = np.random.default_rng(seed)
    return noisy_frames(random, RIGS[bits].camera, [level] * count, shape)


@pytest.mark.parametrize(("bits", "shape"), list(itertools.product((8, 12), SHAPES)))
@pytest.mark.parametrize("level", [0.0, 0.01, 0.7, 1.2])
def test_live_frames_pass(bits: int, shape: tuple[int, int], level: float) -> None:
    watch = FrozenPicture(RIGS[bits].camera)
    for seed, count in enumerate((1, 2, 4, 16)):
        watch.require_live(series(bits, level, count, shape, seed))


@pytest.mark.parametrize(("bits", "shape"), list(itertools.product((8, 12), SHAPES)))
@pytest.mark.parametrize("count", [1, 2, 4])
def test_a_picture_that_stays_is_refused_in_a_series_and_after_it(
    bits: int, shape: tuple[int, int], count: int
) -> None:
    frames = series(bits, 0.5, count, shape, seed=count)
    watch = FrozenPicture(RIGS[bits].camera)
    watch.require_live(frames)
    again = [replace(frame, image=frame.image.copy()) for frame in frames]
    with pytest.raises(Interlock, match=rf"frozen picture: frame 1 of {count} equals an earlier"):
        watch.require_live(again[::-1])  # buffers handed out over and over, in any order
    with pytest.raises(Interlock, match="frozen picture: frame 3 of 3"):
        FrozenPicture(RIGS[bits].camera).require_live(
            [*series(bits, 0.5, 2, shape, seed=9), *series(bits, 0.5, 2, shape, seed=9)[1:]]
        )


@pytest.mark.parametrize(("bits", "level"), [(8, 2.0), (12, 2.0)])
def test_saturated_frames_may_be_equal(bits: int, level: float) -> None:
    watch = FrozenPicture(RIGS[bits].camera)
    for _ in range(3):
        watch.require_live(series(bits, level, 2, (60, 70), seed=1))


def test_a_quiet_sensor_may_repeat_itself_in_the_dark() -> None:
    """8 bit, read noise of a twelfth of a count; the same sensor may not in the light."""
    camera = RIGS[8].camera.model_copy(update={"read_noise_electrons": 20.0})
    dark = Frame(np.full((480, 640), 8, np.uint8), 0.01, 0.0)
    FrozenPicture(camera).require_live([dark, dark])
    lit = Frame(np.full((480, 640), 100, np.uint8), 0.01, 0.0)
    with pytest.raises(Interlock):
        FrozenPicture(camera).require_live([lit, lit])


@pytest.mark.parametrize(("bits", "level"), list(itertools.product((8, 12), (0.0, 0.1, 0.7))))
def test_at_least_as_many_pixels_differ_as_predicted(bits: int, level: float) -> None:
    for seed in range(5):
        first, second = series(bits, level, 2, (60, 70), seed)
        expected = differing_pixels(first.image, RIGS[bits].camera)
        assert expected <= np.count_nonzero(first.image != second.image)


def test_the_comparison_costs_less_than_one_pass_over_the_frame() -> None:
    frames = series(12, 0.7, 4, (960, 1280), seed=1)
    watch = FrozenPicture(RIGS[12].camera)
    images = [frame.image.astype(np.float64) for frame in frames]
    one_pass = cpu_seconds(lambda: [image.sum() for image in images], 9)
    assert cpu_seconds(lambda: watch_anew(watch, frames), 9) < one_pass


def watch_anew(watch: FrozenPicture, frames: list[Frame]) -> None:
    watch.require_live([])
    watch.require_live(frames)
