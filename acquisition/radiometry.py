"""From frames to the mean count of the window, with its uncertainty and its flags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.exposure import NEARLY_FULL
from acquisition.window import Window
from instrument.devices import Frame, Image
from instrument.geometry import FloatArray
from instrument.rig_config import Camera


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

    `u_placement_dn` has the sign of the change for a sample that stands too near the camera.
    """

    signal_dn: float
    u_noise_dn: float
    u_quantisation_dn: float
    u_dark_dn: float
    u_placement_dn: float
    saturated_pixels: int
    peak_dn: float
    flags: str


def dark_of(frames: Sequence[Frame], camera: Camera) -> Dark:
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
    camera: Camera,
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
        _rounding(window, mean, camera),
        float(np.hypot(dark_noise, _rounding(window, dark.mean[window.crop], camera))),
        u_placement_mm * _change_per_mm(frames, dark, window),
        saturated,
        peak,
        _flags(window, min_pixels, saturated, peak, camera),
    )


def _mean_and_variance(images: Sequence[Image], camera: Camera) -> tuple[FloatArray, FloatArray]:
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


def _rounding(window: Window, mean: FloatArray, camera: Camera) -> float:
    """Standard uncertainty that rounding to whole counts leaves in the window's mean, DN.

    The noise that dithers it is the rig file's: that of the counts contains the rounding itself.
    """
    return rounding_u_dn(window.mean(_photon_transfer(mean, camera)))


def _photon_transfer(mean: FloatArray, camera: Camera) -> FloatArray:
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


def _change_per_mm(frames: Sequence[Frame], dark: Dark, window: Window) -> float:
    """How the window's mean changes when the surface stands 1 mm nearer to the camera, DN per mm.

    The surface then appears shifted, and the window sees what belongs on the other side.
    """
    columns, rows = window.shift_px_per_mm
    across = _slope(frames, dark, window, (0, 1)) * columns
    return -(across + _slope(frames, dark, window, (1, 0)) * rows)


def _slope(frames: Sequence[Frame], dark: Dark, window: Window, step: tuple[int, int]) -> float:
    """Change of the window's mean when the window moves by `step` (rows, columns), DN."""
    ahead, behind = (_moved(window.crop, by, step) for by in (1, -1))
    inside = all(s.start >= 0 for s in behind) and all(
        s.stop <= size for s, size in zip(ahead, dark.mean.shape, strict=True)
    )
    if not window.inside_frame or not inside:
        return 0.0
    image = frames[0].image  # one frame is enough for a part of the uncertainty
    change = image[ahead].astype(np.float64) - image[behind]
    change -= dark.mean[ahead] - dark.mean[behind]
    return window.mean(change) / 2


def _moved(crop: tuple[slice, slice], by: int, step: tuple[int, int]) -> tuple[slice, slice]:
    rows, columns = (
        slice(s.start + by * n, s.stop + by * n) for s, n in zip(crop, step, strict=True)
    )
    return rows, columns


def _flags(window: Window, min_pixels: int, saturated: int, peak_dn: float, camera: Camera) -> str:
    """What is wrong with the reading, separated by semicolons; empty when nothing is."""
    flags = {
        "window leaves frame": not window.inside_frame,
        "too few pixels": window.pixels < min_pixels,
        "saturated": saturated > 0 or peak_dn >= NEARLY_FULL * camera.max_dn,
    }
    return "; ".join(name for name, raised in flags.items() if raised)
