"""Small pictures as PNG, without the charts' library, which takes a hundred times as long."""

from __future__ import annotations

import base64

import numpy as np
from numpy.typing import NDArray

from instrument.geometry import FloatArray

Pixels = NDArray[np.uint8]

_RISE, _FALL, _ZERO = (213, 94, 0), (0, 114, 178), (242, 242, 242)  # colours of the charts


def grey_pixels(values: FloatArray, white: float) -> Pixels:
    """Return pixels (R, C, 3), 0 to 255, of values (R, C) from 0 to `white`, in one unit.

    A screen then shines in proportion to the value (sRGB, IEC 61966-2-1). NaN is black.
    """
    share = np.clip(np.nan_to_num(values) / white, 0.0, 1.0)
    bent = 1.055 * np.maximum(share, 0.0031308) ** (1 / 2.4) - 0.055
    encoded = np.where(share <= 0.0031308, 12.92 * share, bent)
    grey = np.round(255 * encoded).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=-1)


def difference_pixels(values: FloatArray, most: float) -> Pixels:
    """Return pixels (R, C, 3), 0 to 255, of differences (R, C) from -most to most, in one unit.

    Orange above 0, blue below, almost white at 0; NaN is black.
    """
    share = np.clip(np.nan_to_num(values) / most, -1.0, 1.0)[..., None]
    ends = np.where(share > 0, np.array(_RISE, dtype=float), np.array(_FALL, dtype=float))
    mixed = np.array(_ZERO) + np.abs(share) * (ends - np.array(_ZERO))
    mixed = np.where(np.isfinite(values)[..., None], mixed, 0.0)
    return np.asarray(np.round(mixed).astype(np.uint8))


def png_of(pixels: Pixels) -> bytes:
    """Return a PNG file of pixels of shape (R, C, 3), red, green and blue from 0 to 255 counts."""
    import cv2

    smallest = [cv2.IMWRITE_PNG_COMPRESSION, 9]
    return bytes(cv2.imencode(".png", pixels[..., ::-1], smallest)[1].tobytes())


def image_html(pixels: Pixels, label: str) -> str:
    """Return the picture of pixels (R, C, 3), 0 to 255 counts, as an element of a page.

    `label`: in HTML, for readers of a screen.
    """
    rows, columns, _ = pixels.shape
    png = base64.b64encode(png_of(pixels)).decode("ascii")
    return (
        f'<svg viewBox="0 0 {columns} {rows}" role="img" aria-label="{label}">'
        f'<image width="{columns}" height="{rows}" href="data:image/png;base64,{png}"/></svg>'
    )
