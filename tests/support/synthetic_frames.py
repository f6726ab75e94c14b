"""Frames of a flat field by an ideal sensor, and a window over all of their pixels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acquisition.measure.placement import Placement
from acquisition.measure.radiometry import Dark, Signal, average_dark, measure
from acquisition.measure.window import Window
from instrument.config.camera import CameraConfig
from instrument.config.load import load_rig
from instrument.config.rig import Rig
from instrument.devices import Frame
from instrument.geometry import FloatArray
from tests.support.paths import CONFIGS

RIGS = {
    12: load_rig(CONFIGS / "rigs" / "bench_12bit.yaml"),
    8: load_rig(CONFIGS / "rigs" / "paper_1995.yaml"),
}
"""Rig files by the bit depth of their camera."""


def window_of(shape: tuple[int, int]) -> Window:
    """Window of equal weights over all pixels of an image of that shape."""
    return Window(
        crop=(slice(0, shape[0]), slice(0, shape[1])),
        weights=np.full(shape, 1 / (shape[0] * shape[1])),
        counted=np.ones(shape, bool),
        outline_px=np.zeros((4, 2)),
        pixels=float(shape[0] * shape[1]),
        inside_frame=True,
        shift_px_per_mm=(0.0, 0.0),
    )


def noisy_frames(
    random: np.random.Generator,
    camera: CameraConfig,
    levels: Sequence[float] | FloatArray,
    shape: tuple[int, int],
    gain: float = 1.0,
) -> list[Frame]:
    """Frames whose signal is `levels` (frames,) as a share of the range, of the rig's noise.

    `gain`: true electrons per count, relative to the rig file.
    """
    per_dn, span = gain * camera.electrons_per_dn, camera.max_dn - camera.black_level_dn
    images = []
    for level in levels:
        electrons = level * span * per_dn
        noise = np.sqrt(max(electrons, 0.0) + camera.read_noise_electrons**2)
        counts = camera.black_level_dn + random.normal(electrons, noise, shape) / per_dn
        whole = np.clip(np.rint(counts), 0, camera.max_dn)
        images.append(whole.astype(np.uint8 if camera.bit_depth == 8 else np.uint16))
    return [Frame(image, 0.01, 0.0) for image in images]


def dark_of(random: np.random.Generator, camera: CameraConfig, shape: tuple[int, int]) -> Dark:
    """Dark of 8 frames."""
    return average_dark(noisy_frames(random, camera, [0.0] * 8, shape), camera)


def signal_of(frames: Sequence[Frame], dark: Dark, rig: Rig) -> Signal:
    """Mean over all pixels of the frames."""
    window = window_of(dark.mean.shape)
    return measure(frames, dark, window, rig.camera, Placement(0.0, 0.0, 1.0), 1)
