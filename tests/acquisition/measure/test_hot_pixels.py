"""Hot pixels: left out by the darks, recorded, and part of the uncertainty."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.measure.hot_pixels import (
    find_hot_pixels,
    hot_pixel_text,
    without_dead_pixels,
    without_hot_pixels,
)
from acquisition.measure.placement import Placement
from acquisition.measure.radiometry import (
    SATURATED_SHARE,
    Dark,
    average_dark,
    measure,
    photon_transfer,
)
from acquisition.measure.window import window_at
from acquisition.results.reduction import reduced_run
from instrument.config.camera import CameraDefects
from instrument.config.simulated.sample import SimulatedSample
from instrument.devices import Frame
from instrument.pinhole import Pinhole
from instrument.record.record import Record
from tests.support.scans import changed, small_scan
from tests.support.whole_scans.stopped_scan import scan

SMALL = small_scan()
CAMERA = SMALL.rig.camera
SHAPE = (CAMERA.height_px, CAMERA.width_px)
ON_AXIS = Placement(0.0, 0.0, 1.0)
WINDOW = window_at(0.0, Pinhole.of(SMALL.rig), 20.0, 20.0)
MIDDLE = (round(CAMERA.axis_row_px), round(CAMERA.axis_column_px))


def test_one_hot_pixel_flags_no_point_of_a_dark_sample(tmp_path: Path) -> None:
    """20 ke-/s in the middle of the window; the sample needs 0.5 s and more."""
    row, column = MIDDLE
    hot = {"row": row, "column": column, "electrons_per_s": 20_000.0}
    dark_sample = SimulatedSample(model="lambert", parameters={"albedo": 0.04})
    found = []
    for pixels in ([], [hot]):
        defects = CameraDefects.model_validate({"hot_pixels": pixels})
        simulation = SMALL.rig.simulation.model_copy(update={"camera_defects": defects})
        loaded = changed(SMALL, rig={"simulation": simulation}, simulated_sample=dark_sample)
        with Record.create(tmp_path / str(len(pixels)), {}) as record:
            scan(loaded, record)
            found.append((reduced_run(record, loaded), record.readings()))
            texts = [text for _, kind, text in record.events() if kind == "hot pixels"]
    (clean, _), (spoilt, readings) = found
    assert max(r.exposure_s for r in readings) > 0.5
    assert not any(spoilt.flags)
    deviation = (spoilt.radiance - clean.radiance) / np.hypot(spoilt.u_radiance, clean.u_radiance)
    assert np.max(np.abs(deviation)) < 3
    assert texts
    assert all(t.startswith("1 hot pixels") and f"({row}, {column})" in t for t in texts)


def _textured(seed: int, spread: float) -> np.ndarray:
    return np.random.default_rng(seed).normal(1500.0, spread, SHAPE)


@given(
    seed=st.integers(0, 10**6), count=st.integers(1, 12), spread=st.floats(1.0, 150.0),
    excess=st.floats(0.06, 1.0),
)  # fmt: skip
def test_leaving_out_hot_pixels_changes_the_mean_within_the_stated_uncertainty(
    seed: int, count: int, spread: float, excess: float
) -> None:
    random, image = np.random.default_rng(seed), _textured(seed, spread)
    rows, columns = (random.integers(s.start, s.stop, count) for s in WINDOW.crop)
    level = np.full(SHAPE, CAMERA.black_level_dn)
    level[rows, columns] += excess * (CAMERA.max_dn - CAMERA.black_level_dn)
    clean_dark = Dark(1.0, np.full(SHAPE, CAMERA.black_level_dn), np.ones(SHAPE), 8)
    hot_dark = replace(clean_dark, mean=level, hot=find_hot_pixels(level, CAMERA))
    assert hot_dark.hot is not None
    assert set(map(tuple, np.argwhere(hot_dark.hot))) == set(zip(rows, columns, strict=True))
    hot_image = np.minimum(image + level - CAMERA.black_level_dn, CAMERA.max_dn)
    clean, spoilt = (
        measure([Frame(np.rint(i).astype(np.uint16), 1.0, 0.0)], d, WINDOW, CAMERA, ON_AXIS, 100)
        for i, d in ((image, clean_dark), (hot_image, hot_dark))
    )
    # A pixel at a corner of the crop may be outside the window, which then stays the same.
    assert abs(spoilt.signal_dn - clean.signal_dn) <= 6 * spoilt.u_texture_dn
    assert spoilt.flags == clean.flags == ""
    assert spoilt.window_pixels <= clean.window_pixels


def test_the_glow_of_an_amplifier_is_no_hot_pixel() -> None:
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    glow = 64.0 + 1500.0 * np.exp(-(rows**2 + columns**2) / 900.0)
    assert not find_hot_pixels(glow, CAMERA).any()
    frames = [Frame(np.rint(glow).astype(np.uint16), 1.0, 0.0)] * 4
    assert average_dark(frames, CAMERA).hot is None


def test_a_window_without_hot_pixels_stays_the_same() -> None:
    hot = np.zeros(SHAPE, bool)
    hot[0, 0] = True
    assert without_hot_pixels(WINDOW, hot) == (WINDOW, 0.0)
    assert without_hot_pixels(WINDOW, None) == (WINDOW, 0.0)
    hot[MIDDLE] = True
    left, share = without_hot_pixels(WINDOW, hot)
    assert left.weights.sum() == pytest.approx(WINDOW.weights.sum())
    assert share == pytest.approx(1 / WINDOW.pixels, rel=0.02)


@given(st.integers(0, 10), st.integers(0, 10**6))
def test_saturation_is_flagged_above_a_share_of_the_window(count: int, seed: int) -> None:
    """Glints that are not in the darks: few pixels are part of the uncertainty."""
    big = window_at(0.0, Pinhole.of(SMALL.rig), 40.0, 40.0)
    inside = np.argwhere(big.weights > 0.5 * big.weights.max())
    chosen = np.random.default_rng(seed).choice(len(inside), count, replace=False)
    image = np.full(SHAPE, 1500, np.uint16)
    for row, column in inside[chosen]:
        image[big.crop[0].start + row, big.crop[1].start + column] = CAMERA.max_dn
    dark = Dark(1.0, np.full(SHAPE, CAMERA.black_level_dn), np.ones(SHAPE), 8)
    signal = measure([Frame(image, 1.0, 0.0)], dark, big, CAMERA, ON_AXIS, 100)
    share = float(big.weights[big.counted & (image[big.crop] == CAMERA.max_dn)].sum())
    assert signal.saturated_pixels == count
    assert (signal.flags == "saturated") == (share > SATURATED_SHARE)
    assert signal.u_texture_dn == pytest.approx(share * (CAMERA.max_dn - CAMERA.black_level_dn))


def test_many_hot_pixels_flag_the_point() -> None:
    hot = np.zeros(SHAPE, bool)
    hot[WINDOW.crop] = np.random.default_rng(1).random(WINDOW.weights.shape) < 0.02
    dark = Dark(1.0, np.full(SHAPE, CAMERA.black_level_dn), np.ones(SHAPE), 8, hot)
    frame = Frame(np.full(SHAPE, 1500, np.uint16), 1.0, 0.0)
    assert measure([frame], dark, WINDOW, CAMERA, ON_AXIS, 100).flags == "hot pixels"
    dark = replace(dark, hot=None)
    assert measure([frame], dark, WINDOW, CAMERA, ON_AXIS, 100).flags == ""


def test_all_positions_are_told_up_to_a_thousand() -> None:
    hot = np.ones((40, 30), bool)
    text = hot_pixel_text(0.5, hot)
    assert text.startswith("1200 hot pixels at 0.5 s")
    assert text.endswith("and 200 more")
    assert text.count("(") - 1 == 1000


@given(
    seed=st.integers(0, 10**6), count=st.integers(1, 12), spread=st.floats(1.0, 150.0),
    frames=st.integers(1, 4),
)  # fmt: skip
def test_leaving_out_dead_pixels_changes_the_mean_within_the_stated_uncertainty(
    seed: int, count: int, spread: float, frames: int
) -> None:
    random, image = np.random.default_rng(seed), np.rint(_textured(seed, spread))
    rows, columns = (random.integers(s.start, s.stop, count) for s in WINDOW.crop)
    dead_image = image.copy()
    dead_image[rows, columns] = 0.0
    dark = Dark(1.0, np.full(SHAPE, CAMERA.black_level_dn), np.ones(SHAPE), 8)
    clean, spoilt = (
        measure([Frame(i.astype(np.uint16), 1.0, 0.0)] * frames, dark, WINDOW, CAMERA, ON_AXIS, 100)
        for i in (image, dead_image)
    )
    # A single pixel of a normal texture is beyond 6 u once in 5e8.
    assert abs(spoilt.signal_dn - clean.signal_dn) <= 6 * max(spoilt.u_texture_dn, 1e-9)
    assert spoilt.flags == ""


@pytest.mark.parametrize("columns", [1, 20])
def test_dead_columns_are_left_out_or_flagged(columns: int) -> None:
    image = np.full(SHAPE, 1500, dtype=np.uint16)
    image[:, MIDDLE[1] : MIDDLE[1] + columns] = 0
    dark = Dark(1.0, np.full(SHAPE, CAMERA.black_level_dn), np.ones(SHAPE), 8)
    found = measure([Frame(image, 1.0, 0.0)], dark, WINDOW, CAMERA, ON_AXIS, 100)
    assert found.flags == "dead pixels"  # a column is more than 1 % of a small window
    assert found.signal_dn == pytest.approx(1500 - CAMERA.black_level_dn, rel=1e-3)


def test_no_noise_of_a_black_sample_is_a_dead_pixel() -> None:
    random = np.random.default_rng(3)
    noise = np.sqrt(photon_transfer(np.array(CAMERA.black_level_dn), CAMERA))
    for frames, dark_frames in ((1, 1), (1, 16), (4, 4)):
        level = random.normal(CAMERA.black_level_dn, noise, (frames + dark_frames, *SHAPE))
        counts = np.rint(level)
        signal = counts[:frames].mean(axis=0) - counts[frames:].mean(axis=0)
        variance = np.full(SHAPE, noise**2 * (1 / frames + 1 / dark_frames))
        kept, share = without_dead_pixels(WINDOW, signal[WINDOW.crop], variance[WINDOW.crop])
        assert kept is WINDOW
        assert share == 0.0
