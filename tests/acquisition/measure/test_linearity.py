"""Counts in proportion to exposures, and frames closer together than their exposure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.measure.linearity import dark_at, proportion, require_possible_times
from acquisition.measure.radiometry import Dark
from acquisition.measure.window import Window, window_at
from instrument.config.load import load_rig
from instrument.devices import Frame
from instrument.errors import DeviceError
from instrument.pinhole import Pinhole
from tests.support.paths import CONFIGS

RIG = load_rig(CONFIGS / "rigs" / "bench_12bit.yaml")
SMALL = RIG.camera.model_copy(
    update={"width_px": 64, "height_px": 51, "axis_row_px": 25.0, "axis_column_px": 32.0}
)
RANDOM = np.random.default_rng(5)


def window(size: float = 20.0) -> Window:
    return window_at(0.0, Pinhole.of(RIG.model_copy(update={"camera": SMALL})), size, size)


def frame(said_s: float, true_s: float, rate_dn_per_s: float) -> Frame:
    mean = SMALL.black_level_dn + rate_dn_per_s * true_s
    counts = RANDOM.normal(mean, 3.0, (SMALL.height_px, SMALL.width_px))
    return Frame(np.clip(np.rint(counts), 0, SMALL.max_dn).astype(np.uint16), said_s, 0.0)


def dark(exposure_s: float, level_dn: float = SMALL.black_level_dn) -> Dark:
    shape = (SMALL.height_px, SMALL.width_px)
    return Dark(exposure_s, np.full(shape, level_dn), np.ones(shape), 8)


@given(
    exposure_s=st.floats(1e-3, 1.0),
    ratio=st.floats(1.5, 16.0),
    level=st.floats(0.3, 0.9),
    error=st.floats(-0.5, 0.5),
)
def test_an_exposure_that_is_off_by_more_than_three_per_cent_is_found(
    exposure_s: float, ratio: float, level: float, error: float
) -> None:
    rate = level * (SMALL.max_dn - SMALL.black_level_dn) / exposure_s
    darks = {exposure_s: dark(exposure_s)}
    shorter = [frame(exposure_s / ratio, exposure_s / ratio * (1 + error), rate)]
    longer = [frame(exposure_s, exposure_s, rate) for _ in range(2)]
    found = proportion(shorter, longer, darks, window(), SMALL)
    if found is None:  # saturated: the shorter one was longer
        assert error > 0.4
        return
    assert proportion(longer, shorter, darks, window(), SMALL) == found
    if abs(error) > 0.03:
        assert found.contradicts
    if abs(error) < 0.01:
        assert found.confirms
    assert found.expected == pytest.approx(ratio)


def test_what_cannot_be_compared() -> None:
    darks = {0.1: dark(0.1)}
    good, rate = [frame(0.1, 0.1, 2e4)], 2e4
    assert proportion([frame(0.09, 0.09, rate)], good, darks, window(), SMALL) is None  # too close
    saturated = [frame(0.4, 0.4, rate)]
    assert proportion(good, saturated, darks, window(), SMALL) is None
    assert proportion([frame(0.02, 0.02, rate)], good, darks, window(), SMALL) is not None
    unlit = [frame(0.02, 0.02, 0.0)]
    noise = proportion(unlit, [frame(0.1, 0.1, 0.0)], darks, window(), SMALL)
    assert noise is None or not noise.confirms


def test_a_flickering_lamp_is_no_contradiction_within_its_scatter() -> None:
    darks = {0.1: dark(0.1)}
    flickering = [frame(0.1, 0.1, rate) for rate in (2.0e4, 2.2e4, 1.8e4, 2.1e4)]
    found = proportion([frame(0.025, 0.025, 2.2e4)], flickering, darks, window(), SMALL)
    assert found is not None
    assert not found.contradicts
    assert not found.confirms


def test_the_dark_of_an_exposure_is_estimated_from_others() -> None:
    known = {0.1: dark(0.1, 70.0), 0.2: dark(0.2, 80.0)}
    assert dark_at(0.1, known, SMALL) == (known[0.1], 0.0)
    between, u = dark_at(0.15, known, SMALL)
    assert (float(between.mean.mean()), u) == (pytest.approx(75.0), 0.0)
    single, u = dark_at(0.05, {0.1: known[0.1]}, SMALL)
    assert float(single.mean.mean()) == pytest.approx((70.0 + SMALL.black_level_dn) / 2)
    assert u == pytest.approx((70.0 - SMALL.black_level_dn) / 2)


@given(
    exposure_s=st.floats(1e-3, 2.0), count=st.integers(2, 9), faster=st.floats(0.2, 2.0),
    jitter=st.lists(st.floats(0.0, 0.001), min_size=9, max_size=9),
)  # fmt: skip
def test_frames_closer_together_than_their_exposure_are_refused(
    exposure_s: float, count: int, faster: float, jitter: list[float]
) -> None:
    image = np.zeros((2, 2), np.uint8)
    period_s = faster * exposure_s
    frames = [Frame(image, exposure_s, 0.0, 100 + n * period_s + jitter[n]) for n in range(count)]
    if period_s < 0.9 * exposure_s - 0.004:
        with pytest.raises(DeviceError, match=r"camera: its frames come every .* max_exposure_s"):
            require_possible_times(frames)
    elif period_s >= exposure_s:
        require_possible_times(frames)
    require_possible_times([replace(f, device_time_s=None) for f in frames])
