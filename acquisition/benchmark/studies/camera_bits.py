"""Bits and frames: seconds on the bench against the error of a window's mean.

A sensor is simulated pixel by pixel, from electrons with photon and read noise (normal, as from
some hundred electrons on) to rounded counts, with its darks; the truth is the light put in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import numpy as np

from acquisition.benchmark.effort import Effort
from acquisition.benchmark.number_text import rounded
from acquisition.benchmark.study import Study
from acquisition.benchmark.trial import Trial
from acquisition.measure.radiometry import rounding_u_dn
from instrument.geometry import FloatArray

BITS, FRAMES = (8, 10, 12, 16), (1, 4, 16, 64)
DEFAULT = (12, 4)
PIXELS = 1000  # of the window at 75 degrees and more, where it is smallest
DARK_FRAMES = 8
_FULL_WELL, _OVERHEAD_S, _EXPOSURE_S = 30000.0, 0.02, 0.05  # as of the bench_12bit rig
_BLACK_PART = 64 / 4095  # of full scale


@dataclass(frozen=True, slots=True)
class Scene:
    """Light as a part of the full well, and read noise in electrons."""

    name: str
    level: float
    read_noise_electrons: float


SCENES = (
    Scene("bright: 70 % of full scale", 0.7, 8.0),
    Scene("dark: 1 % of full scale", 0.01, 8.0),
    Scene("dark, and a quiet sensor", 0.01, 1.5),
)


def bits_study(effort: Effort) -> Study:
    """All bits and frames in all scenes."""
    trials = tuple(
        _trial(scene, bits, frames, effort.draws)
        for scene, bits, frames in product(SCENES, BITS, FRAMES)
    )
    return Study(
        "camera_bits",
        "Camera: bits against frames",
        "time per point (s)",
        "relative error of the window’s mean, rms",
        _caption(trials),
        f"the light put into a simulated sensor; {PIXELS} pixels, {DARK_FRAMES} dark frames, "
        f"{effort.draws} draws",
        trials,
        error_is="rms",
        joined=True,
    )


def _caption(trials: tuple[Trial, ...]) -> str:
    def error(scene: Scene, bits: int) -> float:
        label = _label(bits, DEFAULT[1])
        return next(t.error for t in trials if (t.scene, t.label) == (scene.name, label))

    ratio = {s.name: error(s, 8) / error(s, 12) for s in SCENES}
    words = "; ".join(f"{rounded(value)} ({name})" for name, value in ratio.items())
    return (
        f"With {DEFAULT[1]} frames 8 bits are worse than 12 by these factors: {words}. Where it is "
        "bright nearly all of that comes with the dark, which no noise dithers.\nWhere noise is "
        "wider than a count it takes the place of bits, and only frames help; where it is not, "
        "frames do not help, and only bits do."
    )


def _label(bits: int, frames: int) -> str:
    return f"{bits} bit × {frames}"


def _trial(scene: Scene, bits: int, frames: int, draws: int) -> Trial:
    off = np.abs(errors(scene, bits, frames, draws))
    return Trial(
        "camera_bits",
        scene.name,
        f"{bits} bit",
        _label(bits, frames),
        frames * (_EXPOSURE_S + _OVERHEAD_S),
        float(np.sqrt(np.mean(off**2))),
        float(np.median(off)),
        (bits, frames) == DEFAULT,
        more={"u_rounding_relative": _u_rounding(scene, bits)},
    )


def _u_rounding(scene: Scene, bits: int) -> float:
    """What the program itself states for rounding, of light and dark together, relative."""
    gain, electrons = _electrons_per_dn(bits), scene.level * _FULL_WELL
    noise2 = scene.read_noise_electrons**2
    both = [rounding_u_dn(variance / gain**2) for variance in (electrons + noise2, noise2)]
    return math.hypot(*both) * gain / electrons


def errors(scene: Scene, bits: int, frames: int, draws: int) -> FloatArray:
    """Relative errors of the mean, less the dark, in `draws` readings of slightly other levels.

    The levels differ by a count's width, so that rounding strikes each differently.
    """
    random = np.random.default_rng([bits, frames, round(1e4 * scene.level)])
    gain = _electrons_per_dn(bits)
    levels = scene.level * _FULL_WELL + gain * random.uniform(-0.5, 0.5, draws)
    black = _BLACK_PART * (2**bits - 1) + random.uniform(-0.5, 0.5, draws)
    found = np.empty(draws)
    for n, (electrons, offset) in enumerate(zip(levels, black, strict=True)):
        light = _mean_dn(random, electrons, offset, scene, bits, frames)
        dark = _mean_dn(random, 0.0, offset, scene, bits, DARK_FRAMES)
        found[n] = (light - dark) * gain / electrons - 1
    return found


def _electrons_per_dn(bits: int) -> float:
    counts = float(2**bits - 1) * (1 - _BLACK_PART)
    return _FULL_WELL / counts


def _mean_dn(
    random: np.random.Generator,
    electrons: float,
    black_dn: float,
    scene: Scene,
    bits: int,
    frames: int,
) -> float:
    """Mean count of all pixels and frames."""
    shape = (frames, PIXELS)
    gain = _electrons_per_dn(bits)
    noise_dn = math.sqrt(electrons + scene.read_noise_electrons**2) / gain
    counts = random.standard_normal(shape, dtype=np.float32)
    counts *= np.float32(noise_dn)
    counts += np.float32(electrons / gain + black_dn)
    np.clip(np.rint(counts, out=counts), 0, 2**bits - 1, out=counts)
    return float(np.mean(counts, dtype=np.float64))
