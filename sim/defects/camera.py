"""Defects of a camera: false exposures, hot, dead and unequal pixels, response, limited range."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from instrument.config.camera import (
    LIMITED_BLACK_DN,
    LIMITED_WHITE_DN,
    CameraConfig,
    CameraDefects,
)
from instrument.devices import Image
from instrument.geometry import FloatArray

_FULL_DN = 255  # white of the full range

FloatImage = NDArray[np.float32]


def true_exposure_s(set_s: float, defects: CameraDefects) -> float:
    """Return the exposure of the sensor in seconds when the control is set to `set_s`."""
    if defects.fixed_exposure_s is not None:
        return defects.fixed_exposure_s
    exposure_s = set_s
    if defects.exposures_s is not None:
        exposure_s = min(defects.exposures_s, key=lambda known_s: abs(known_s - set_s))
    if defects.longest_exposure_s is not None:
        exposure_s = min(exposure_s, defects.longest_exposure_s)
    return exposure_s


def read_back_s(set_s: float, defects: CameraDefects) -> float:
    """Return the exposure in seconds that the camera reports after it was set to `set_s`."""
    return true_exposure_s(set_s, defects) if defects.reads_back == "taken" else set_s


def hot_electrons_per_s(
    shape: tuple[int, int], defects: CameraDefects, random: np.random.Generator
) -> FloatArray | None:
    """Return the extra dark current (rows, columns) in electrons/s; None without hot pixels."""
    if not defects.hot_pixels and not defects.hot_share:
        return None
    current = np.zeros(shape)
    if defects.hot_share:
        hot = random.random(shape) < defects.hot_share
        current[hot] = random.exponential(defects.hot_electrons_per_s, int(hot.sum()))
    for pixel in defects.hot_pixels:
        current[pixel.row, pixel.column] += pixel.electrons_per_s
    return current


def unequal_responses(
    shape: tuple[int, int], defects: CameraDefects, random: np.random.Generator
) -> FloatImage | None:
    """Return the relative response to light of each pixel (rows, columns); None if all equal."""
    if not (defects.prnu or defects.dead_pixels or defects.dead_share):
        return None
    responses = (1 + defects.prnu * random.standard_normal(shape)).astype(np.float32)
    if defects.dead_share:
        responses[random.random(shape) < defects.dead_share] = 0.0
    for pixel in defects.dead_pixels:
        responses[pixel.row, pixel.column] = 0.0
    return responses


def dark_current_factor(age_s: float, defects: CameraDefects) -> float:
    """Return the factor of all dark currents by the warmth `age_s` after the start of the scan."""
    if not defects.warming_k:
        return 1.0
    warmer_k = -defects.warming_k * math.expm1(-max(age_s, 0.0) / defects.warming_s)
    return float(2 ** (warmer_k / defects.doubling_k))


def unequal_darks_electrons(
    shape: tuple[int, int], defects: CameraDefects, random: np.random.Generator
) -> FloatImage | None:
    """Return the excess dark signal in electrons (rows, columns); None if all pixels are equal."""
    if not defects.dsnu_electrons:
        return None
    return (defects.dsnu_electrons * random.standard_normal(shape)).astype(np.float32)


def is_bent(defects: CameraDefects) -> bool:
    """Return True if counts are not proportional to the light."""
    return defects.gamma != 1.0 or defects.nonlinearity != 0.0


def bent(counts: FloatImage, camera: CameraConfig, defects: CameraDefects) -> FloatImage:
    """Return a picture (rows, columns), in DN before rounding, after the camera's response curve.

    Nothing is below black after a gamma, as in a camera that computes it.
    """
    black, span = np.float32(camera.black_level_dn), np.float32(camera.max_dn)
    share = (counts - black) / (span - black)
    if defects.gamma != 1.0:
        share = np.maximum(share, 0) ** np.float32(1 / defects.gamma)
    share += np.float32(defects.nonlinearity) * share * (1 - share)
    return black + (span - black) * share


def limit_range(image: Image, defects: CameraDefects) -> Image:
    """Return an image, (rows, columns) in counts, with the black and white of limited range.

    Images of more than 8 bits stay as they are: limited range is a property of 8-bit video.
    """
    if defects.limited_range == "none" or image.dtype != np.uint8:
        return image
    scaled = LIMITED_BLACK_DN + image * ((LIMITED_WHITE_DN - LIMITED_BLACK_DN) / _FULL_DN)
    counts: Image = np.rint(scaled).astype(np.uint8)
    return counts
