"""Window means, their uncertainty and their flags, on synthetic frames."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from acquisition.measure.placement import Placement
from acquisition.measure.radiometry import Dark, average_dark, bright_level, measure
from acquisition.measure.window import Window, window_at
from instrument.config.load import load_rig
from instrument.devices import Frame
from instrument.pinhole import Pinhole
from tests.support.paths import CONFIGS

RIG = load_rig(CONFIGS / "rigs" / "bench_12bit.yaml")
CAMERA = RIG.camera
ON_AXIS = Placement(0.0, 0.0, RIG.lamp_distance_mm)
SHAPE = (CAMERA.height_px, CAMERA.width_px)


def _window(theta_r: float = 0.0, size: float = 20.0) -> Window:
    return window_at(theta_r, Pinhole.of(RIG), size, size)


def _frames(mean: float, sd: float, count: int, seed: int = 1) -> list[Frame]:
    random = np.random.default_rng(seed)
    return [
        Frame(np.rint(random.normal(mean, sd, SHAPE)).astype(np.uint16), 0.01, 0.0)
        for _ in range(count)
    ]


@cache
def _dark() -> Dark:
    return average_dark(_frames(64.0, 1.1, 8, seed=2), CAMERA)


def test_the_dark_is_subtracted_and_cos4_divided_out() -> None:
    flat = [Frame(np.full(SHAPE, 1064, np.uint16), 0.01, 0.0)] * 2
    no_noise = Dark(0.01, np.full(SHAPE, 64.0), np.zeros(SHAPE), 8)
    rows, columns = np.ogrid[_window().crop]
    falloff = Pinhole.of(RIG).cos4(columns, rows)
    expected = 1000 * np.sum(_window().weights * falloff / falloff)
    signal = measure(flat, no_noise, _window(), CAMERA, ON_AXIS, 100)
    assert signal.signal_dn == pytest.approx(expected)
    assert signal.signal_dn == pytest.approx(1000, rel=1e-3)  # cos^4 is within 1e-3 of 1 here


def test_the_stated_noise_is_the_spread_of_repeated_measurements() -> None:
    window = _window(75.0, 4.0)  # few pixels, so that the noise shows
    series = [
        measure(_frames(1500, 20, 4, seed), _dark(), window, CAMERA, ON_AXIS, 1)
        for seed in range(60)
    ]
    spread = np.std([s.signal_dn for s in series], ddof=1)
    # 59 degrees of freedom: the spread is known to 9 %.
    assert np.mean([s.u_noise_dn for s in series]) == pytest.approx(spread, rel=0.3)


def test_a_single_frame_takes_its_noise_from_the_photon_transfer_curve() -> None:
    gain = CAMERA.electrons_per_dn
    electrons = (1500 - CAMERA.black_level_dn) * gain
    sd = np.sqrt(electrons + CAMERA.read_noise_electrons**2) / gain
    one = measure(_frames(1500, sd, 1), _dark(), _window(), CAMERA, ON_AXIS, 100)
    many = measure(_frames(1500, sd, 16), _dark(), _window(), CAMERA, ON_AXIS, 100)
    assert one.u_noise_dn == pytest.approx(4 * many.u_noise_dn, rel=0.1)


def test_the_effect_of_a_misplaced_sample_follows_the_gradient_of_the_image() -> None:
    """An image that brightens along its rows, seen obliquely, of a sample 1 mm too close."""
    window, camera = _window(60.0), Pinhole.of(RIG)
    ramp = np.broadcast_to(1000 + 2 * np.arange(SHAPE[1]), SHAPE).astype(np.uint16)
    dark = Dark(0.01, np.full(SHAPE, 64.0), np.zeros(SHAPE), 8)
    placement = Placement(1.0, 0.0, 1e9)  # of a lamp so far away that its light does not change
    signal = measure([Frame(ramp, 0.01, 0.0)] * 2, dark, window, CAMERA, placement, 100)
    near, on_axis = (camera.project([0.0, 0.0], 60.0, h)[0] for h in (1.0, 0.0))
    # The surface has moved to the left, so the window sees what belongs further right.
    assert signal.u_placement_dn == pytest.approx(2 * (on_axis - near), rel=0.01)


@pytest.mark.parametrize("roll_deg", [0.0, 45.0, 90.0, -120.0])
def test_the_shift_of_a_misplaced_sample_turns_with_the_camera(roll_deg: float) -> None:
    camera = replace(Pinhole.of(RIG), roll_deg=roll_deg)
    columns, rows = window_at(60.0, camera, 20.0, 20.0).shift_px_per_mm
    # 640 pixels for 72 mm, seen at sin 60; against the columns at no roll.
    shift = 640 / 72 * np.sin(np.radians(60.0))
    assert np.hypot(columns, rows) == pytest.approx(shift, rel=2e-3)
    assert np.degrees(np.arctan2(-rows, -columns)) == pytest.approx(roll_deg, abs=0.5)


@pytest.mark.parametrize(
    ("level", "size", "theta_r", "flag"),
    [
        (4095, 20.0, 0.0, "saturated"),
        (1500, 0.5, 80.0, "too few pixels"),
        (1500, 90.0, 0.0, "window leaves frame"),
        (1500, 20.0, 0.0, ""),
    ],
)
def test_every_defect_is_flagged(level: int, size: float, theta_r: float, flag: str) -> None:
    frames = [Frame(np.full(SHAPE, level, np.uint16), 0.01, 0.0)] * 2
    signal = measure(frames, _dark(), _window(theta_r, size), CAMERA, ON_AXIS, 100)
    assert signal.flags == flag


@pytest.mark.parametrize("part", [-0.3, -0.15, 0.15, 0.3])
def test_a_dark_between_two_counts_is_subtracted_as_it_is(part: float) -> None:
    """Noise of a quarter count leaves up to 0.09 counts of rounding in its mean."""
    dark = average_dark(_frames(64 + part, 0.25, 8, seed=4), CAMERA)
    light = _frames(1064 + part, 3.0, 4, seed=5)
    signal = measure(light, dark, _window(), CAMERA, ON_AXIS, 100)
    plain = measure(
        [Frame(np.full(SHAPE, 1000, np.uint16), 0.01, 0.0)] * 2,
        Dark(0.01, np.zeros(SHAPE), np.zeros(SHAPE), 8),
        _window(),
        CAMERA,
        ON_AXIS,
        100,
    )
    assert abs(signal.signal_dn - plain.signal_dn) < 4 * signal.u_noise_dn < 0.04
    assert signal.u_dark_dn < 0.01


@pytest.mark.parametrize(("kind", "largest"), [(np.uint8, 255), (np.uint16, 4095)])
def test_the_bright_level_is_the_99th_percentile_of_the_sorted_counts(
    kind: type[np.uint8 | np.uint16], largest: int
) -> None:
    random = np.random.default_rng(3)
    for size in (1, 2, 99, 100, 101, 5000):
        counts = random.integers(0, largest + 1, size).astype(kind)
        assert bright_level(counts) == np.sort(counts)[int(0.99 * (size - 1))]
