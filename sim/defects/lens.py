"""Defects of the lens: vignetting, distortion, and scattered light (veiling glare).

Images are (rows, columns). Distances are measured from the optical axis of the lens, in units of
half the picture's diagonal.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from instrument.config.simulated.defects import LensDefects
from instrument.geometry import FloatArray

_COARSE = 4  # pixels of the coarse picture in the glare's width: smooth enough for 1e-3 of it

FloatImage = NDArray[np.float32]


def transmission(shape: tuple[int, int], lens: LensDefects) -> FloatImage:
    """Return the share of the light that vignetting leaves in each pixel, (rows, columns)."""
    columns, rows, _ = _from_axis(shape, lens)
    left: FloatImage = np.maximum(1 - lens.vignetting * (columns**2 + rows**2), 0)
    return left.astype(np.float32)


def bent_by_lens(image: FloatImage, lens: LensDefects) -> FloatImage:
    """Return the picture with distortion; where it sees beyond the edge, the edge goes on.

    Division model (Fitzgibbon, CVPR 2001): the point at distance r of the distorted picture belongs
    at r / (1 + k r^2); k is the relative displacement at distance 1.
    """
    if not lens.distortion:
        return image
    columns, rows, half = _from_axis((image.shape[0], image.shape[1]), lens)
    squared = columns**2 + rows**2
    # Displacement alone, in double precision: on the axis itself nothing moves at all.
    move = half * (1 / (1 + lens.distortion * squared) - 1)
    from_column = np.arange(image.shape[1]) + move * columns
    from_row = np.arange(image.shape[0])[:, np.newaxis] + move * rows
    maps = from_column.astype(np.float32), from_row.astype(np.float32)
    bent = cv2.remap(image, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(bent, dtype=np.float32)


def veiled(light: FloatImage, share: float, width_px: float) -> FloatImage:
    """Return the picture with a share of its light scattered; what leaves the frame is lost.

    Point spread w / (2 pi (r^2 + w^2)^1.5) of the scattered light, with `width_px` w: integral 1.
    Its tail is a power of the distance, as fits of the stray light of cameras have it (Bitlis,
    Jansson, Allebach and Wei, WO 2008/089385); the third is assumed.
    """
    step = max(1, round(width_px / _COARSE))
    rows, columns = light.shape
    size = -(-columns // step), -(-rows // step)
    coarse = cv2.resize(light, size, interpolation=cv2.INTER_AREA)
    steps = columns / size[0], rows / size[1]
    spread = _convolved(np.asarray(coarse, dtype=np.float64), width_px, steps).astype(np.float32)
    smooth = cv2.resize(spread, (columns, rows), interpolation=cv2.INTER_LINEAR)
    veil: FloatImage = light + np.float32(share) * (np.asarray(smooth, dtype=np.float32) - light)
    return veil


def _convolved(coarse: FloatArray, width_px: float, steps: tuple[float, float]) -> FloatArray:
    """Convolve with the point spread; `steps`: pixels per coarse column and row."""
    rows, columns = coarse.shape
    y = np.fft.fftfreq(2 * rows, 0.5 / rows)[:, np.newaxis] * steps[1]
    x = np.fft.fftfreq(2 * columns, 0.5 / columns) * steps[0]
    kernel = steps[0] * steps[1] * width_px / (2 * np.pi * (x**2 + y**2 + width_px**2) ** 1.5)
    spectrum = np.fft.rfft2(coarse, s=kernel.shape) * np.fft.rfft2(kernel)
    return np.fft.irfft2(spectrum, s=kernel.shape)[:rows, :columns]


def _from_axis(shape: tuple[int, int], lens: LensDefects) -> tuple[FloatArray, FloatArray, float]:
    """Columns (1, columns) and rows (rows, 1) from the axis, and half the diagonal in pixels."""
    rows, columns = shape
    half = float(np.hypot(rows, columns)) / 2
    from_column = (
        np.arange(columns, dtype=np.float64) - (columns - 1) / 2 - lens.axis_column_px
    ) / half
    from_row = (np.arange(rows, dtype=np.float64) - (rows - 1) / 2 - lens.axis_row_px) / half
    return from_column[np.newaxis, :], from_row[:, np.newaxis], half
