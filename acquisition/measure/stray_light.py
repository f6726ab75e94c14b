"""Dark patch beside the sample, seen in the same frames: it shows the stray light of the lens.

A lens scatters a share of all light over the picture. Near grazing view the sample is a narrow
strip: less of its light is scattered into the window than at normal view, so that the BRDF falls by
1 % or so where the lens scatters 2 %. A patch that reflects nothing shows that light alone.

How far the lens scatters is not known. Its point spread is taken as a sum of three Gaussians of
different widths, and for each the frame itself, in coarse cells, says what would fall into window
and patch. `acquisition.measure.scattering` finds their shares from all readings of a run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.measure.hot_pixels import without_hot_pixels
from acquisition.measure.radiometry import Dark, Signal, photon_transfer
from acquisition.measure.rounding import dark_rounding_dn, rounding_u_dn
from acquisition.measure.window import Window, window_at
from instrument.config.camera import CameraConfig, DarkPatch
from instrument.config.protocol import PatchConfig
from instrument.config.rig import Rig
from instrument.devices import Frame
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole

LEAVES, BRIGHT = "dark patch leaves frame", "dark patch is bright"
# Standard deviations of the Gaussians, in widths of the picture: the narrowest just reaches from
# the sample to the patch, the widest is almost an even veil, as the integral method of ISO 9358 has
# it.
_WIDTHS = (0.05, 0.15, 0.45)
_LEAST_PIXELS = 5  # fewer may lie on its edges; u holds their noise
_PART_READ = 0.5  # of width and height of the patch
# Share of the light that is scattered: ISO 9358 indices of bad lenses are about 10 %; the patch may
# get twice as much as the middle Gaussian says.
_MOST_SHARE = 0.2
_COLUMNS = 80  # of the coarse picture
_SAMPLED = 8  # of so many rows and columns one is enough for the mean dark


@dataclass(frozen=True, slots=True)
class View:
    """Rig and measured patch of a scan, and the angles in degrees of one reading."""

    rig: Rig
    window: PatchConfig
    theta_i_deg: float
    theta_r_deg: float


def with_dark_patch(signal: Signal, frames: Sequence[Frame], dark: Dark, view: View) -> Signal:
    """Return a signal with what its frames say of stray light; unchanged without a dark patch."""
    patch, camera = view.rig.camera.dark_patch, view.rig.camera
    if patch is None:
        return signal
    pinhole = Pinhole.of(view.rig)
    seen, _ = without_hot_pixels(_seen(patch, view.theta_r_deg, pinhole), dark.hot)
    if not seen.inside_frame or seen.pixels < _LEAST_PIXELS:
        return _flagged(signal, LEAVES)
    level, u_level = _level_dn(frames, dark, seen, camera)
    size = view.window.width_mm, view.window.height_mm
    light = _light(frames[0].image, dark)
    into_window, into_patch = (
        (weights @ light).tolist() for weights in _kernels(view.theta_r_deg, pinhole, patch, size)
    )
    found = replace(
        signal,
        patch_dn=level,
        u_patch_dn=u_level,
        near_window_dn=into_window[0],
        middle_window_dn=into_window[1],
        far_window_dn=into_window[2],
        near_patch_dn=into_patch[0],
        middle_patch_dn=into_patch[1],
        far_patch_dn=into_patch[2],
    )
    own = white_dn(view.rig, view.theta_i_deg, frames[0].exposure_s) * patch.reflectance
    bright = level - own - 6 * u_level > _MOST_SHARE * into_patch[1]
    return _flagged(found, BRIGHT) if bright else found


def white_dn(rig: Rig, theta_i_deg: float, exposure_s: float) -> float:
    """Return the counts of white that the rig file predicts, in DN."""
    cos_i = max(0.0, float(np.cos(np.radians(theta_i_deg))))
    return rig.lamp.white_electrons_per_s * cos_i * exposure_s / rig.camera.electrons_per_dn


def _flagged(signal: Signal, flag: str) -> Signal:
    return replace(signal, flags="; ".join(filter(None, (signal.flags, flag))))


def _seen(patch: DarkPatch, theta_r_deg: float, pinhole: Pinhole) -> Window:
    """Return the part of the patch that is read: blur and errors of place leave it dark."""
    size = _PART_READ * patch.width_mm, _PART_READ * patch.height_mm
    return window_at(theta_r_deg, pinhole, *size, (patch.x_mm, patch.y_mm))


def _level_dn(
    frames: Sequence[Frame], dark: Dark, seen: Window, camera: CameraConfig
) -> tuple[float, float]:
    """Return the mean of the patch over all frames, its dark subtracted, and its u, in DN."""
    dark_mean, dark_variance = dark.mean[seen.crop], dark.variance[seen.crop]
    rounding, u_rounding = dark_rounding_dn(dark_mean, dark_variance, seen.weights, dark.frames)
    counts = [seen.mean(camera.linear_dn(frame.image[seen.crop])) for frame in frames]
    level = float(np.mean(counts)) - seen.mean(dark_mean) + rounding * float(seen.weights.sum())
    variance = float(photon_transfer(np.asarray(camera.black_level_dn + level), camera))
    noise = variance * (1 / len(frames) + 1 / dark.frames) * float(np.sum(seen.weights**2))
    return level, float(np.sqrt(noise + u_rounding**2 + rounding_u_dn(variance) ** 2))


def _light(image: NDArray[Any], dark: Dark) -> FloatArray:
    """Return the light of a picture in DN by coarse cells (cells,), 0 or more."""
    black = float(dark.mean[::_SAMPLED, ::_SAMPLED].mean())
    light: FloatArray = np.maximum(_coarse(image) - black, 0.0).ravel()
    return light


def _coarse(image: NDArray[Any]) -> FloatArray:
    """Return the means of square cells of a picture, `_COLUMNS` in a row at most.

    Pixels that do not fill a cell, at the right and lower edges, are left out.
    """
    import cv2

    side = -(-image.shape[1] // _COLUMNS)
    rows, columns = (size // side for size in image.shape)
    whole = image[: rows * side, : columns * side]
    cells = cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA)
    return np.asarray(cells, dtype=np.float64)


@lru_cache(maxsize=512)
def _kernels(
    theta_r_deg: float, pinhole: Pinhole, patch: DarkPatch, window_mm: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """Return the weights (Gaussians, cells) of each cell's light in window and patch."""
    windows = window_at(theta_r_deg, pinhole, *window_mm), _seen(patch, theta_r_deg, pinhole)
    shape = pinhole.height_px, pinhole.width_px
    into_window, into_patch = (_spread_back(window, shape) for window in windows)
    return into_window, into_patch


def _spread_back(window: Window, shape: tuple[int, int]) -> FloatArray:
    """Return the weights (Gaussians, cells) of each cell's light in a window of the picture."""
    whole = np.zeros(shape, dtype=np.float32)
    whole[window.crop] = window.weights
    weights = _coarse(whole)
    weights *= window.weights.sum() / max(float(weights.sum()), 1e-30)
    rows, columns = (_gaussians(size, weights.shape[1]) for size in weights.shape)
    spread = [down @ weights @ across.T for down, across in zip(rows, columns, strict=True)]
    return np.array(spread).reshape(len(_WIDTHS), -1)


def _gaussians(size: int, width: int) -> FloatArray:
    """Return for each Gaussian the share (to, from) of a cell's light in others of its row.

    `size`: cells in the row; `width`: cells in the picture's width. Light beyond the picture is
    lost.
    """
    apart = np.subtract.outer(np.arange(size), np.arange(size))
    sigma = width * np.array(_WIDTHS)[:, np.newaxis, np.newaxis]
    shares: FloatArray = np.exp(-((apart / sigma) ** 2) / 2) / (np.sqrt(2 * np.pi) * sigma)
    return shares
