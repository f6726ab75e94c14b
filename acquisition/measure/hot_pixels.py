"""Hot pixels: found in the darks, left out of the window's mean.

The dark current of a hot pixel is subtracted with the dark, but it fills the pixel's well: at a
long exposure the pixel saturates although the sample is dark.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acquisition.measure.window import Window
from instrument.config.camera import CameraConfig
from instrument.geometry import BoolArray, FloatArray

LARGEST_EXCESS = 0.05  # of the range of counts: a pixel so much above its neighbours is hot
_NEIGHBOURS = 5  # rows and columns around a pixel; the glow of an amplifier is even over them
_MOST_NAMED = 1000


def find_hot_pixels(dark_dn: FloatArray, camera: CameraConfig) -> BoolArray:
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
    if own is None or not own.any():
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
