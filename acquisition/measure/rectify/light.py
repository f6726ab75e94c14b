"""Light of each pixel: mean of frames, made linear, less the dark, and even over the picture.

The same steps as those of the window's mean (`acquisition.measure.radiometry`), for all pixels. Hot
pixels take the median of their neighbours, and saturated ones have no value.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.measure.radiometry import SATURATION_FRACTION
from acquisition.measure.window import window_at
from instrument.config.camera import CameraConfig
from instrument.config.protocol import PatchConfig
from instrument.geometry import BoolArray
from instrument.pinhole import Pinhole

FloatImage = NDArray[np.float32]
_PLANE = 2  # axes of a picture without colour


def light_dn(
    images: Sequence[NDArray[Any]],
    dark_dn: NDArray[Any] | float,
    hot: BoolArray | None,
    camera: CameraConfig,
    pinhole: Pinhole,
) -> FloatImage:
    """Return the light of each pixel in DN, (rows, columns), NaN where any frame is saturated.

    images: counts (rows, columns). dark_dn: mean dark in linear counts, of the same shape or one
    for all. hot: True for a hot pixel. Divided by cos^4, as the window's weights are.
    """
    import cv2

    total = camera.linear_dn(images[0]).astype(np.float32)
    for image in images[1:]:
        total += camera.linear_dn(image)
    total /= len(images)
    total -= np.asarray(dark_dn, dtype=np.float32)
    if hot is not None and hot.any():
        total[hot] = cv2.medianBlur(total, 3)[hot]
    limit = SATURATION_FRACTION * camera.max_dn
    bright = np.any([image >= limit for image in images if int(image.max()) >= limit], axis=0)
    total *= _per_cos4(pinhole)
    if np.any(bright):
        total[bright if hot is None else bright & ~hot] = np.nan
    return total


def window_dn(
    light: FloatImage,
    theta_r_deg: float,
    pinhole: Pinhole,
    patch: PatchConfig,
    centre_mm: tuple[float, float] = (0.0, 0.0),
) -> float:
    """Return the mean light of the measured patch over its area, in DN, pixels with NaN apart.

    light: (rows, columns) in DN, as `light_dn` returns it; theta_r is signed. centre_mm:
    of the patch, from the rotation axis.
    """
    window = window_at(theta_r_deg, pinhole, patch.width_mm, patch.height_mm, centre_mm)
    rows, columns = np.ogrid[window.crop]
    area = window.weights * pinhole.cos4(columns, rows)
    own = light[window.crop]
    known = np.isfinite(own)
    return float(np.sum(area[known] * own[known]) / max(float(area[known].sum()), 1e-30))


def channels_of(picture: NDArray[Any]) -> list[NDArray[Any]]:
    """Return the channels (rows, columns) each of a picture in any unit, one if it has no colour.

    picture: (rows, columns), or (rows, columns, channels).
    """
    if picture.ndim == _PLANE:
        return [picture]
    return [np.ascontiguousarray(channel) for channel in np.moveaxis(picture, -1, 0)]


@lru_cache(maxsize=2)
def _per_cos4(pinhole: Pinhole) -> FloatImage:
    rows, columns = np.ogrid[: pinhole.height_px, : pinhole.width_px]
    return (1 / pinhole.cos4(columns, rows)).astype(np.float32)
