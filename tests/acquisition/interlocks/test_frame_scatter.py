"""Scatter of frames: sound ones pass, flicker is in u, frames that differ are flagged or end it."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from acquisition.interlocks.frame_scatter import FLAG, FrameScatter
from acquisition.measure.radiometry import Signal
from acquisition.measure.window import Window
from instrument.config.rig import Rig
from instrument.devices import Frame
from instrument.errors import Interlock
from tests.support.synthetic_frames import RIGS, dark_of, noisy_frames, signal_of, window_of
from tests.support.timing.cpu_time import cpu_seconds

BITS, COUNTS = (8, 12), (1, 2, 4, 16)
SHAPES, LEVELS = ((5, 6), (60, 70)), (0.0, 0.02, 0.7, 1.2)
KINDS = list(itertools.product(BITS, COUNTS, SHAPES, LEVELS))


@dataclass
class Bench:
    """A rig's frames and the judge of them."""

    bits: int
    shape: tuple[int, int]
    seed: int = 0
    gain: float = 1.0
    events: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.rig: Rig = RIGS[self.bits]
        self.random = np.random.default_rng([self.seed, self.bits, *self.shape])
        self.dark = dark_of(self.random, self.rig.camera, self.shape)
        self.judge = FrameScatter(self.rig, self.events.append)
        self.window: Window = window_of(self.shape)

    def frames(self, levels: object) -> list[Frame]:
        return noisy_frames(
            self.random,
            self.rig.camera,
            np.atleast_1d(levels),  # type: ignore[call-overload]  # numbers
            self.shape,
            self.gain,
        )

    def signals(self, frames: list[Frame]) -> tuple[Signal, Signal]:
        """Measured, with the scatter that only the judge tells, and judged."""
        signal = signal_of(frames, self.dark, self.rig)
        judged = self.judge.judged(signal, frames, self.dark, self.window, "step 3")
        told = {"u_pixel_dn": judged.u_pixel_dn, "scatter_dn": judged.scatter_dn}
        return replace(signal, **told), judged

    def scan(self, flicker: float, count: int) -> None:
        """Judge 49 readings under a lamp that flickers."""
        for _ in range(49):
            levels = 0.6 * (1 + self.random.normal(0.0, flicker, count))
            self.signals(self.frames(levels))

    def blacken(self, frame: Frame) -> Frame:
        """Frame of which the lower half is black."""
        image = frame.image.copy()
        image[image.shape[0] // 2 :] = round(self.rig.camera.black_level_dn)
        return replace(frame, image=image)


@pytest.mark.slow
@pytest.mark.parametrize("bits", BITS)
@pytest.mark.parametrize("gain", [0.25, 1.0, 4.0])
def test_sound_frames_keep_their_values_and_their_u(bits: int, gain: float, slow: bool) -> None:
    """Also of a camera whose full well is not that of the rig file: dark, bright and saturated."""
    for count, shape, level in itertools.product(COUNTS, SHAPES, LEVELS):
        bench = Bench(bits, shape, gain=gain)
        for _ in range(6 if slow else 2):
            signal, judged = bench.signals(bench.frames([level] * count))
            assert judged == signal, (count, shape, level)
        assert not bench.events


@pytest.mark.slow
@pytest.mark.parametrize(("bits", "count"), list(itertools.product(BITS, (2, 4, 16))))
def test_a_frame_that_is_half_black_flags_its_reading_alone(
    bits: int, count: int, slow: bool
) -> None:
    places = range(count) if slow else {0, count // 2, count - 1}
    for shape, place in itertools.product(SHAPES, places):
        bench = Bench(bits, shape, seed=place)
        for step in range(12):
            frames = bench.frames([0.7] * count)
            if step == 6:
                frames[place] = bench.blacken(frames[place])
            _, judged = bench.signals(frames)
            assert (judged.flags == FLAG) == (step == 6)
        (text,) = bench.events
        assert text.startswith("step 3: frames differ: the window's mean scatters by ")
        assert f"most in frame {place + 1} of {count}" in text or count == 2


@pytest.mark.parametrize(("bits", "count"), list(itertools.product(BITS, (2, 4, 16))))
@pytest.mark.slow
@pytest.mark.parametrize("flicker", [0.01, 0.02, 0.1])
def test_a_lamp_that_flickers_more_than_the_rig_file_says_ends_the_scan(
    bits: int, count: int, flicker: float, slow: bool
) -> None:
    for seed in range(8 if slow else 3):
        bench = Bench(bits, (60, 70), seed=seed)
        with pytest.raises(Interlock, match=r"frames differ, in reading after reading.*u_flicker"):
            bench.scan(flicker, count)


@pytest.mark.parametrize("count", [2, 4, 16])
def test_flicker_that_the_rig_file_allows_is_in_u(count: int) -> None:
    bench = Bench(12, (60, 70), seed=count)
    pulls = []
    for _ in range(150):
        levels = 0.6 * (1 + bench.random.normal(0.0, 0.003, count))
        signal, judged = bench.signals(bench.frames(levels))
        truth = 0.6 * (bench.rig.camera.max_dn - bench.rig.camera.black_level_dn)
        assert (judged.flags, judged.signal_dn) == ("", signal.signal_dn)
        pulls.append((signal.signal_dn - truth) / judged.u_noise_dn)
    beyond = np.mean(np.abs(pulls) > 3)
    assert not bench.events
    assert beyond <= {2: 0.06, 4: 0.02, 16: 0.01}[count]  # two frames may agree by chance


@pytest.mark.parametrize("flicker", [0.0008, 0.0015, 0.003])
def test_flicker_that_was_seen_is_in_the_u_of_every_later_reading(flicker: float) -> None:
    """Also of readings whose two frames agree: too small a u would draw a fit to them."""
    for seed in range(6):
        bench, ratios = Bench(12, (60, 70), seed=100 + seed), []
        for _ in range(60):
            levels = 0.6 * (1 + bench.random.normal(0.0, flicker, 2))
            signal, judged = bench.signals(bench.frames(levels))
            true_u = np.hypot(signal.u_noise_dn, flicker * signal.signal_dn / np.sqrt(2))
            ratios.append(judged.u_noise_dn / true_u)
        assert min(ratios[20:]) > 0.65
        assert 0.85 < np.median(ratios[20:]) < 1.4


def test_a_single_frame_has_nothing_to_compare() -> None:
    bench = Bench(12, (60, 70))
    signal, judged = bench.signals(bench.frames([0.7]))
    assert judged == signal


def test_a_single_frame_has_the_flicker_of_the_readings_before_it() -> None:
    bench = Bench(12, (60, 70), seed=3)
    bench.signals(bench.frames(0.6 * (1 + np.array([0.003, -0.002, 0.001, -0.004]))))
    signal, judged = bench.signals(bench.frames([0.3]))
    assert judged.u_noise_dn == pytest.approx(0.003 * signal.signal_dn, rel=0.05)
    assert judged.flags == ""


def test_a_dark_reading_may_wander_by_a_part_of_a_count() -> None:
    """Black level that is regulated to 0.1 counts: u is raised, nothing is flagged."""
    bench = Bench(12, (60, 70))
    span = bench.rig.camera.max_dn - bench.rig.camera.black_level_dn
    for _ in range(40):
        levels = 0.004 + bench.random.normal(0.0, 0.1, 4) / span
        signal, judged = bench.signals(bench.frames(levels))
        assert judged.flags == ""
        assert judged.u_noise_dn >= signal.u_noise_dn


@pytest.mark.slow
def test_false_alarms_are_as_rare_as_stated(slow: bool) -> None:
    """Of sound readings one in 30 000 gets a larger u, and none in 50 million a flag."""
    raised, total = 0, 0
    for seed in range(150 if slow else 2):
        for bits, count, shape, level in KINDS:
            bench = Bench(bits, shape, seed=1000 + seed)
            for _ in range(4):
                signal, judged = bench.signals(bench.frames([level] * count))
                assert judged.flags == signal.flags
                raised += judged != signal
                total += count > 1
    assert raised <= 2 + total / 10_000


def test_the_judgement_costs_less_than_the_measurement() -> None:
    bench = Bench(12, (400, 400))
    frames = bench.frames([0.7] * 4)
    signal = signal_of(frames, bench.dark, bench.rig)
    judge = cpu_seconds(
        lambda: bench.judge.judged(signal, frames, bench.dark, bench.window, "step 1"), 9
    )
    assert judge < 0.5 * cpu_seconds(lambda: signal_of(frames, bench.dark, bench.rig), 9)
