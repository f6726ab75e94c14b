"""Mean count of the measuring window over a series of frames, with its uncertainty and flags."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.measure.hot_pixels import (
    find_hot_pixels,
    without_dead_pixels,
    without_hot_pixels,
)
from acquisition.measure.placement import Placement, placement_u_dn
from acquisition.measure.rounding import dark_rounding_dn, rounding_u_dn
from acquisition.measure.window import Window
from instrument.config.camera import CameraConfig
from instrument.devices import TRUSTED_SHARE, Frame
from instrument.geometry import BoolArray, FloatArray

SATURATION_FRACTION = TRUSTED_SHARE
# Shares of the window's weight, above which a reading is flagged; less is part of its uncertainty.
SATURATED_SHARE, HOT_SHARE = 0.001, 0.01
LEAVES_FRAME, FEW_PIXELS = "window leaves frame", "too few pixels"


@dataclass(frozen=True, slots=True)
class Dark:
    """Dark of one exposure: `mean` (rows, columns) in DN, `variance` in DN^2, over `frames`.

    `hot` (rows, columns): True for a hot pixel, which does not count; None for none. `light_dn`:
    light in it, see `acquisition.interlocks.darks`. `colour`: mean of a colour camera's channels,
    (rows, columns, 3) in DN.
    """

    exposure_s: float
    mean: FloatArray
    variance: FloatArray
    frames: int
    hot: BoolArray | None = None
    light_dn: float = 0.0
    colour: NDArray[np.float32] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """Mean of a window in counts (DN); the u are standard uncertainties of `signal_dn`.

    `u_placement_dn` is the first-order effect of a misplaced sample, with the sign of the change
    for a sample too close to the camera; `u_texture_dn` is the second-order effect, with the effect
    of hot and dead pixels left out and of single saturated ones. `window_pixels`: area that counts.
    `patch_dn` and what follows it: see `acquisition.measure.stray_light`; `u_pixel_dn` and
    `scatter_dn`: see `Reading`, and `acquisition.interlocks.frame_scatter`, which sets them.
    """

    signal_dn: float
    u_noise_dn: float
    u_quantisation_dn: float
    u_dark_dn: float
    u_placement_dn: float
    u_texture_dn: float
    window_pixels: float
    saturated_pixels: int
    peak_dn: float
    flags: str
    patch_dn: float = 0.0
    u_patch_dn: float = 0.0
    near_window_dn: float = 0.0
    middle_window_dn: float = 0.0
    far_window_dn: float = 0.0
    near_patch_dn: float = 0.0
    middle_patch_dn: float = 0.0
    far_patch_dn: float = 0.0
    u_pixel_dn: float = 0.0
    scatter_dn: float = 0.0


def average_dark(frames: Sequence[Frame], camera: CameraConfig) -> Dark:
    """Return the dark of a series of frames taken without light, in linear counts."""
    images = [camera.linear_dn(frame.image) for frame in frames]
    mean, variance = _mean_and_variance(images, camera)
    hot = find_hot_pixels(mean, camera)
    return Dark(
        frames[0].exposure_s, mean, variance, len(frames), hot if hot.any() else None,
        colour=_mean_colour(frames),
    )  # fmt: skip


def _mean_colour(frames: Sequence[Frame]) -> NDArray[np.float32] | None:
    """Return the mean of the channels (rows, columns, 3) in DN; None without colour."""
    pictures = [frame.colour for frame in frames if frame.colour is not None]
    if not pictures:
        return None
    total = np.zeros(pictures[0].shape, dtype=np.float32)
    for picture in pictures:
        total += picture
    return total / np.float32(len(pictures))


def bright_level(counts: NDArray[Any]) -> float:
    """Return the 99th percentile of whole counts of any shape, in DN: the exposure is set by it."""
    rank = int(0.99 * (counts.size - 1))
    up_to = np.cumsum(np.bincount(counts.ravel()))
    return float(np.searchsorted(up_to, rank, side="right"))


def measure(
    frames: Sequence[Frame],
    dark: Dark,
    window: Window,
    camera: CameraConfig,
    placement: Placement,
    min_pixels: int,
) -> Signal:
    """Return the window's mean over all frames minus the dark, with uncertainty and flags.

    Each pixel's counts are made linear before they are averaged, where the camera is calibrated.
    """
    window, hot_share = without_hot_pixels(window, dark.hot)
    crops = [frame.image[window.crop] for frame in frames]
    mean, variance = _mean_and_variance([camera.linear_dn(crop) for crop in crops], camera)
    dark_mean, dark_variance = dark.mean[window.crop], dark.variance[window.crop]
    black = photon_transfer(dark_mean, camera) * (1 / len(frames) + 1 / dark.frames)
    window, dead_share = without_dead_pixels(window, mean - dark_mean, black)
    counted = frames[0].brightest(window.crop)[window.counted]
    saturated = [(crop >= camera.max_dn) & window.counted for crop in crops]
    saturated_weight = float(np.mean([window.weights[pixels].sum() for pixels in saturated]))
    peak = bright_level(counted) if counted.size else float("nan")
    rounding, u_rounding = dark_rounding_dn(dark_mean, dark_variance, window.weights, dark.frames)
    u_dark_noise = _u_noise(window, dark_variance / dark.frames)
    # In another pose the light in a dark is between none and twice as much, with equal probability.
    u_light = dark.light_dn * float(window.weights.sum()) / math.sqrt(3.0)
    first = frames[0].image
    u_placement, u_texture = placement_u_dn(first, dark.mean, window, placement, camera.linear_dn)
    u_left_out = (hot_share + dead_share) * _spread(mean - dark_mean, window)
    # A saturated pixel is short of its true count by up to full scale, or more.
    u_saturated = saturated_weight * (camera.max_dn - camera.black_level_dn)
    return Signal(
        signal_dn=window.mean(mean - dark_mean + rounding),
        u_noise_dn=_u_noise(window, variance / len(frames)),
        u_quantisation_dn=_u_rounding(window.mean(mean), camera),
        u_dark_dn=math.hypot(u_dark_noise, u_rounding, u_light),
        u_placement_dn=u_placement,
        u_texture_dn=math.hypot(u_texture, u_left_out, u_saturated),
        window_pixels=window.pixels,
        saturated_pixels=sum(int(np.count_nonzero(pixels)) for pixels in saturated),
        peak_dn=peak,
        flags=_flags(window, min_pixels, (saturated_weight, hot_share, dead_share), peak, camera),
    )


def _spread(signal: FloatArray, window: Window) -> float:
    """Return the standard deviation over the window's pixels of a signal crop in DN."""
    return float(np.std(signal[window.counted])) if window.counted.any() else 0.0


def _mean_and_variance(
    images: Sequence[NDArray[Any]], camera: CameraConfig
) -> tuple[FloatArray, FloatArray]:
    """Return mean (DN) and frame-to-frame variance (DN^2) of every pixel, each (rows, columns).

    Sums of counts and of squared counts are integers far below 2^53, hence exact. A single frame
    has no variance: the rig file's photon-transfer curve is used instead.
    """
    count = len(images)
    total, squares = (np.zeros(images[0].shape) for _ in range(2))
    for image in images:
        counts = image.astype(np.float64)
        total += counts
        squares += np.square(counts, out=counts)
    mean = total / count
    if count == 1:
        return mean, photon_transfer(mean, camera)
    return mean, (squares - total * mean) / (count - 1)


def _u_noise(window: Window, variance: FloatArray) -> float:
    """Return the standard uncertainty of the weighted mean of independent pixels."""
    return float(np.sqrt(np.sum(window.weights**2 * variance)))


def _u_rounding(level_dn: float, camera: CameraConfig) -> float:
    """Return the standard uncertainty due to rounding of a mean of that level, in DN.

    The dithering noise is taken from the rig file: the measured noise contains the rounding.
    """
    return rounding_u_dn(float(photon_transfer(np.asarray(level_dn), camera)))


def photon_transfer(mean: FloatArray, camera: CameraConfig) -> FloatArray:
    """Return the variance of a pixel before rounding, in DN^2: photon and read noise.

    `mean`: counts of any shape in DN, which the result has too.
    """
    gain = camera.electrons_per_dn
    electrons = np.maximum(mean - camera.black_level_dn, 0.0) * gain
    variance: FloatArray = (electrons + camera.read_noise_electrons**2) / gain**2
    return variance


def _flags(
    window: Window,
    min_pixels: int,
    shares: tuple[float, float, float],
    peak_dn: float,
    camera: CameraConfig,
) -> str:
    """Return the reading's flags separated by semicolons; empty if there are none.

    `shares` of the window's weight: saturated pixels, hot and dead ones that were left out.
    """
    saturated, hot, dead = shares
    flags = {
        LEAVES_FRAME: not window.inside_frame,
        FEW_PIXELS: window.pixels < min_pixels,
        "saturated": saturated > SATURATED_SHARE or peak_dn >= SATURATION_FRACTION * camera.max_dn,
        "hot pixels": hot > HOT_SHARE,
        "dead pixels": dead > HOT_SHARE,
    }
    return "; ".join(name for name, raised in flags.items() if raised)
