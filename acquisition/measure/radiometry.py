"""From frames to the mean count of the window, with its uncertainty and its flags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.measure.window import Window
from acquisition.plan.exposure_ladder import NEARLY_FULL
from instrument.config.camera import CameraConfig
from instrument.devices import Frame, Image
from instrument.geometry import FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class Dark:
    """The dark of one exposure: mean of every pixel, its variance, over so many frames (DN)."""

    exposure_s: float
    mean: FloatArray
    variance: FloatArray
    frames: int


@dataclass(frozen=True, slots=True)
class Signal:
    """What a window gave, in counts (DN); the u are standard uncertainties of `signal_dn`.

    `u_placement_dn` has the sign of the change for a sample that stands too near the camera;
    `u_texture_dn` is what a straight line leaves of it.
    """

    signal_dn: float
    u_noise_dn: float
    u_quantisation_dn: float
    u_dark_dn: float
    u_placement_dn: float
    u_texture_dn: float
    saturated_pixels: int
    peak_dn: float
    flags: str


def dark_of(frames: Sequence[Frame], camera: CameraConfig) -> Dark:
    """The dark of a series of frames taken without light."""
    mean, variance = _mean_and_variance([frame.image for frame in frames], camera)
    return Dark(frames[0].exposure_s, mean, variance, len(frames))


def bright_level(counts: NDArray[Any]) -> float:
    """The level that one count in a hundred exceeds: what an exposure is judged by."""
    rank = int(0.99 * (counts.size - 1))
    return float(np.partition(counts.ravel(), rank)[rank])


def measure(
    frames: Sequence[Frame],
    dark: Dark,
    window: Window,
    camera: CameraConfig,
    u_placement_mm: float,
    min_pixels: int,
) -> Signal:
    """The window's mean over all frames, less the dark, with uncertainty and flags."""
    crops = [frame.image[window.crop] for frame in frames]
    counted = [crop[window.counted] for crop in crops]
    mean, variance = _mean_and_variance(crops, camera)
    saturated = sum(int(np.count_nonzero(counts >= camera.max_dn)) for counts in counted)
    peak = bright_level(counted[0]) if counted[0].size else float("nan")
    dark_noise = _noise(window, dark.variance[window.crop] / dark.frames)
    return Signal(
        window.mean(mean - dark.mean[window.crop]),
        _noise(window, variance / len(frames)),
        _rounding(window.mean(mean), camera),
        float(np.hypot(dark_noise, _rounding(window.mean(dark.mean[window.crop]), camera))),
        *_placement(frames, dark, window, u_placement_mm),
        saturated,
        peak,
        _flags(window, min_pixels, saturated, peak, camera),
    )


def _mean_and_variance(
    images: Sequence[Image], camera: CameraConfig
) -> tuple[FloatArray, FloatArray]:
    """Mean and variance from frame to frame of every pixel, DN and DN^2.

    Sums of counts and of their squares are whole numbers far below 2^53, so nothing is rounded.
    A single frame shows no variance: the photon-transfer curve of the rig file stands in for it.
    """
    count = len(images)
    total, squares = (np.zeros(images[0].shape) for _ in range(2))
    for image in images:
        counts = image.astype(np.float64)
        total += counts
        squares += np.square(counts, out=counts)
    mean = total / count
    if count == 1:
        return mean, _photon_transfer(mean, camera)
    return mean, (squares - total * mean) / (count - 1)


def _noise(window: Window, variance: FloatArray) -> float:
    """Standard uncertainty of the weighted mean of independent pixels."""
    return float(np.sqrt(np.sum(window.weights**2 * variance)))


def _rounding(level_dn: float, camera: CameraConfig) -> float:
    """Standard uncertainty that rounding to whole counts leaves in a mean of that level, DN.

    The noise that dithers it is the rig file's: that of the counts contains the rounding itself.
    """
    return rounding_u_dn(float(_photon_transfer(np.asarray(level_dn), camera)))


def _photon_transfer(mean: FloatArray, camera: CameraConfig) -> FloatArray:
    """Variance of a pixel before rounding, DN^2: photons and read noise of the rig file."""
    gain = camera.electrons_per_dn
    electrons = np.maximum(mean - camera.black_level_dn, 0.0) * gain
    variance: FloatArray = (electrons + camera.read_noise_electrons**2) / gain**2
    return variance


def rounding_u_dn(noise_variance_dn2: float) -> float:
    """Error (standard deviation, DN) of the mean of many counts rounded to whole numbers.

    Without noise every pixel rounds alike: 1/sqrt(12) DN. Normal noise of variance s^2 dithers it:
    the Fourier series of the sawtooth error, its k-th term damped by exp(-2 pi^2 k^2 s^2)
    (Widrow and Kollar, Quantization Noise, 2008, chapter 4), averaged over all levels.
    """
    k = np.arange(1, 2000)
    damped = np.exp(-4 * np.pi**2 * k**2 * noise_variance_dn2) / (2 * np.pi**2 * k**2)
    return float(np.sqrt(damped.sum()))


def _placement(
    frames: Sequence[Frame], dark: Dark, window: Window, u_mm: float
) -> tuple[float, float]:
    """What a surface u_mm nearer to the camera does to the window's mean, DN: linear, and the rest.

    The surface then appears shifted, and the window sees what belongs on the other side. The
    picture itself, moved by as much, says how much that changes, and how little of it is linear.
    """
    shift = np.array(window.shift_px_per_mm[::-1]) * u_mm  # rows, columns
    whole = np.rint(shift).astype(int)
    if not whole.any():
        whole[np.argmax(np.abs(shift))] = 1 if shift[np.argmax(np.abs(shift))] >= 0 else -1
    ahead, behind = (_moved(window.crop, by * whole) for by in (1, -1))
    inside = all(
        s.start >= 0 and s.stop <= size
        for crop in (ahead, behind)
        for s, size in zip(crop, dark.mean.shape, strict=True)
    )
    if not u_mm or not window.inside_frame or not inside:
        return 0.0, 0.0
    part = float(np.linalg.norm(shift) / np.linalg.norm(whole))
    before, here, after = (
        window.mean(frames[0].image[crop] - dark.mean[crop])
        for crop in (behind, window.crop, ahead)
    )
    return -part * (after - before) / 2, part**2 * np.sqrt(3) * abs(after + before - 2 * here) / 2


def _moved(crop: tuple[slice, slice], by: IntArray) -> tuple[slice, slice]:
    rows, columns = (slice(s.start + n, s.stop + n) for s, n in zip(crop, by.tolist(), strict=True))
    return rows, columns


def _flags(
    window: Window, min_pixels: int, saturated: int, peak_dn: float, camera: CameraConfig
) -> str:
    """What is wrong with the reading, separated by semicolons; empty when nothing is."""
    flags = {
        "window leaves frame": not window.inside_frame,
        "too few pixels": window.pixels < min_pixels,
        "saturated": saturated > 0 or peak_dn >= NEARLY_FULL * camera.max_dn,
    }
    return "; ".join(name for name, raised in flags.items() if raised)
