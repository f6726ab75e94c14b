"""Picture of a frame for the eye: 8 bit, saturated pixels red; and the numbers that go with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acquisition.measure.window import Window
from instrument.config.camera import CameraConfig
from instrument.devices import Frame, Image

_MOST_PIXELS = 640 * 480  # of a picture on the page; larger frames are shown at half size, or less
_RED = (50, 50, 255)  # blue, green, red
_QUALITY = 85  # of JPEG: texture stays, at about 30 kB


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureNumbers:
    """Counts of a frame in DN, and the outline of its window, (N, 2) pixels as (column, row)."""

    exposure_s: float
    peak_dn: float
    full_scale_dn: float
    saturated_pixels: int
    window_saturated_pixels: int
    window_mean_dn: float | None
    width_px: int
    height_px: int
    outline: list[list[float]]


def numbers_of(frame: Frame, window: Window, camera: CameraConfig) -> PictureNumbers:
    """Return the numbers that go with the picture of a frame; the mean is None without a window."""
    saturated, inside = frame.image >= camera.max_dn, window.counted
    counts = frame.image[window.crop][inside]
    return PictureNumbers(
        exposure_s=frame.exposure_s,
        peak_dn=float(frame.image.max()),
        full_scale_dn=float(camera.max_dn),
        saturated_pixels=int(np.count_nonzero(saturated)),
        window_saturated_pixels=int(np.count_nonzero(saturated[window.crop][inside])),
        window_mean_dn=float(counts.mean()) if counts.size else None,
        width_px=frame.image.shape[1],
        height_px=frame.image.shape[0],
        outline=np.round(window.outline_px, 1).tolist(),
    )


def jpeg_of(image: Image, max_dn: float) -> bytes:
    """Return a frame, (rows, columns) in DN, as a grey JPEG, whole and at most at its own size.

    A saturated pixel (at `max_dn` or above) is a red spot of 3 by 3, which can be seen.
    """
    import cv2

    quality = (cv2.IMWRITE_JPEG_QUALITY, _QUALITY)
    colour = (cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444)
    times = max(1, round((image.size / _MOST_PIXELS) ** 0.5))
    size = (-(-image.shape[1] // times), -(-image.shape[0] // times))
    both = (cv2.convertScaleAbs(image, alpha=255.0 / max_dn), (image >= max_dn) * np.uint8(255))
    grey, red = (cv2.resize(layer, size, interpolation=cv2.INTER_AREA) for layer in both)
    drawn = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
    drawn[cv2.dilate(red, np.ones((3, 3), np.uint8)) > 0] = _RED
    return bytes(cv2.imencode(".jpg", drawn, [*quality, *colour])[1].tobytes())


def sharpness(image: Image, black_level_dn: float) -> float:
    """Return a measure of focus of a frame, (rows, columns) in DN: the larger, the sharper.

    It is relative to the brightness, and has no unit: the root mean square of the gradient,
    after a blur that takes off most of the noise (Tenengrad: Pertuz, Puig and Garcia 2013, Pattern
    Recognition 46, 1415, operator GRA6).
    """
    import cv2

    light = cv2.GaussianBlur(image.astype(np.float32) - np.float32(black_level_dn), (5, 5), 1.0)
    across, down = (cv2.Sobel(light, cv2.CV_32F, *order, scale=1 / 8) for order in ((1, 0), (0, 1)))
    level = float(light.mean())
    return float(np.sqrt(np.mean(across**2 + down**2)) / level) if level > 0 else 0.0
