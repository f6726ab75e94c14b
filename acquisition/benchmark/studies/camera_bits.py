"""Bits and frames: time per point against the error of the window's mean.

A sensor is simulated pixel by pixel, from electrons with photon and read noise (normal, valid from
some hundred electrons on) to rounded counts, with its darks; the truth is the light put in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import numpy as np

from acquisition.benchmark.demo_scan import shipped_demo
from acquisition.benchmark.effort import Effort
from acquisition.benchmark.number_text import rounded
from acquisition.benchmark.studies.method import rms_and_median
from acquisition.benchmark.study import Study
from acquisition.benchmark.trial import Trial, select
from acquisition.measure.rounding import rounding_u_dn
from instrument.config.camera import CameraConfig
from instrument.geometry import FloatArray

BITS, FRAMES = (8, 10, 12, 16), (1, 4, 16, 64)
DEFAULT = (12, 4)
PIXELS = 1000  # of the window at 75 degrees and more, where it is smallest
_EXPOSURE_S = 0.05


@dataclass(frozen=True, slots=True)
class Scene:
    """Light as a fraction of the full well, and read noise in electrons."""

    name: str
    level: float
    read_noise_electrons: float


SCENES = (
    Scene("bright: 70 % of full scale", 0.7, 8.0),
    Scene("dark: 1 % of full scale", 0.01, 8.0),
    Scene("dark, and a quiet sensor", 0.01, 1.5),
)


def bits_study(effort: Effort) -> Study:
    """Compare all bit depths and numbers of frames in all scenes."""
    trials = tuple(
        _trial(scene, bits, frames, effort.draws)
        for scene, bits, frames in product(SCENES, BITS, FRAMES)
    )
    return Study(
        name="camera_bits",
        title="Camera: bits against frames",
        cost_axis="time per point (s)",
        error_axis="relative error of the window’s mean, rms",
        caption=_caption(trials),
        truth=f"the light put into a simulated sensor; {PIXELS} pixels, {_dark_frames()} dark "
        f"frames, {effort.draws} draws",
        trials=trials,
        error_is="rms",
        joined=True,
    )


def _caption(trials: tuple[Trial, ...]) -> str:
    def error(scene: Scene, bits: int) -> float:
        return select(trials, scene=scene.name, label=_label(bits, DEFAULT[1]))[0].error

    ratios = {s.name: error(s, 8) / error(s, 12) for s in SCENES}
    words = "; ".join(f"{rounded(ratio)} ({name})" for name, ratio in ratios.items())
    return (
        f"With {DEFAULT[1]} frames the error at 8 bits exceeds that at 12 bits by these factors: "
        f"{words}. In the bright scene nearly all of it comes from the dark frames, whose noise is "
        "too small to dither them.\nNoise wider than a count replaces bits, and only more frames "
        "reduce the error; with less noise more frames do not help, and only more bits do."
    )


def _label(bits: int, frames: int) -> str:
    return f"{bits} bit × {frames}"


def _trial(scene: Scene, bits: int, frames: int, draws: int) -> Trial:
    sensor = _sensor(scene, bits)
    return Trial(
        study="camera_bits",
        scene=scene.name,
        series=f"{bits} bit",
        label=_label(bits, frames),
        cost=frames * (_EXPOSURE_S + sensor.frame_overhead_s),
        default=(bits, frames) == DEFAULT,
        more={"u_rounding_relative": _u_rounding(scene, sensor)},
        **rms_and_median(reading_errors(scene, sensor, frames, draws)),
    )


def _sensor(scene: Scene, bits: int) -> CameraConfig:
    """Return the demonstration's camera with other bits, and the scene's read noise."""
    camera = shipped_demo().rig.camera
    black = camera.black_level_dn / camera.max_dn * (2**bits - 1)
    noise = scene.read_noise_electrons
    return camera.model_copy(
        update={"bit_depth": bits, "black_level_dn": black, "read_noise_electrons": noise}
    )


def _dark_frames() -> int:
    return shipped_demo().protocol.dark_frames


def _u_rounding(scene: Scene, sensor: CameraConfig) -> float:
    """Relative uncertainty by rounding of plain means, of light and dark together."""
    gain, electrons = sensor.electrons_per_dn, scene.level * sensor.full_well_electrons
    noise2 = sensor.read_noise_electrons**2
    both = [rounding_u_dn(variance / gain**2) for variance in (electrons + noise2, noise2)]
    return math.hypot(*both) * gain / electrons


def reading_errors(scene: Scene, sensor: CameraConfig, frames: int, draws: int) -> FloatArray:
    """Return the relative errors, (draws,), of the mean minus the dark.

    The light levels of the draws differ by up to a count, so that rounding affects each
    differently.
    """
    random = np.random.default_rng([sensor.bit_depth, frames, round(1e4 * scene.level)])
    gain = sensor.electrons_per_dn
    levels = scene.level * sensor.full_well_electrons + gain * random.uniform(-0.5, 0.5, draws)
    black = sensor.black_level_dn + random.uniform(-0.5, 0.5, draws)
    found = np.empty(draws)
    for n, (electrons, offset) in enumerate(zip(levels, black, strict=True)):
        light = _mean_dn(random, sensor, electrons, offset, frames)
        dark = _mean_dn(random, sensor, 0.0, offset, _dark_frames())
        found[n] = (light - dark) * gain / electrons - 1
    return found


def _mean_dn(
    random: np.random.Generator,
    sensor: CameraConfig,
    electrons: float,
    black_dn: float,
    frames: int,
) -> float:
    """Mean count of all pixels and frames."""
    gain = sensor.electrons_per_dn
    noise_dn = math.sqrt(electrons + sensor.read_noise_electrons**2) / gain
    counts = random.standard_normal((frames, PIXELS), dtype=np.float32)
    counts *= np.float32(noise_dn)
    counts += np.float32(electrons / gain + black_dn)
    np.clip(np.rint(counts, out=counts), 0, sensor.max_dn, out=counts)
    return float(np.mean(counts, dtype=np.float64))
