"""Hot and dead pixels: left out of the window's mean.

The dark current of a hot pixel is subtracted with the dark, but it fills the pixel's well: at a
long exposure the pixel saturates although the sample is dark. Hot pixels are found in the darks. A
pixel that has died since then shows less than its dark, which no light does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from acquisition.measure.window import Window
from instrument.config.camera import CameraConfig
from instrument.geometry import BoolArray, FloatArray

LARGEST_EXCESS = 0.05  # of the range of counts: a pixel so much above its neighbours is hot
_BELOW_SIGMA, _BELOW_DN = 8.0, 2.0  # less than a dark by as much is no noise, and no rounding
_NEIGHBOURS = 5  # rows and columns around a pixel; the glow of an amplifier is even over them
_MOST_NAMED = 1000


def find_hot_pixels(dark_dn: NDArray[np.floating], camera: CameraConfig) -> BoolArray:
    """Return True for each hot pixel, (rows, columns), of a mean dark of that shape in DN."""
    import cv2

    counts = dark_dn.astype(np.float32)
    around = cv2.medianBlur(counts, _NEIGHBOURS)
    hot: BoolArray = counts - around > LARGEST_EXCESS * (camera.max_dn - camera.black_level_dn)
    return hot


def without_hot_pixels(window: Window, hot: BoolArray | None) -> tuple[Window, float]:
    """Return the window without hot pixels, and the share of its weight that they had.

    `hot`: (rows, columns) of the whole image, True for a hot pixel. The other weights are raised so
    that their sum stays the same.
    """
    own = None if hot is None else hot[window.crop] & window.counted
    return (window, 0.0) if own is None else _without(window, own)


def without_dead_pixels(
    window: Window, signal_dn: FloatArray, variance_dn2: FloatArray
) -> tuple[Window, float]:
    """Return the window without dead pixels, and the share of its weight that they had.

    `signal_dn`: (rows, columns) of the window's crop, its dark subtracted; `variance_dn2` that of
    noise without light, in the same shape.
    """
    least = -_BELOW_SIGMA * np.sqrt(variance_dn2) - _BELOW_DN
    return _without(window, (signal_dn < least) & window.counted)


def _without(window: Window, own: BoolArray) -> tuple[Window, float]:
    if not own.any():
        return window, 0.0
    share = float(window.weights[own].sum() / window.weights.sum())
    kept = np.where(own, 0.0, window.weights) / max(1.0 - share, 1e-9)
    left = replace(
        window,
        weights=kept,
        counted=window.counted & ~own,
        pixels=max(window.pixels - float(np.count_nonzero(own)), 0.0),
    )
    return left, share


def hot_pixel_text(exposure_s: float, hot: BoolArray) -> str:
    """Return the positions of hot pixels, `hot` (rows, columns), True for one, in words."""
    places = [f"({row}, {column})" for row, column in np.argwhere(hot)[:_MOST_NAMED].tolist()]
    count = int(np.count_nonzero(hot))
    more = f" and {count - _MOST_NAMED} more" if count > _MOST_NAMED else ""
    return (
        f"{count} hot pixels at {exposure_s:g} s are left out of the window's mean, as (row, "
        f"column): {', '.join(places)}{more}"
    )
