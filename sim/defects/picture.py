"""Faults of a picture: light that the lamp did not send, and counts that the sensor did not give.

Images and maps are (rows, columns).
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from instrument.config.camera import CameraConfig
from instrument.config.simulated.defects import LensDefects
from instrument.devices import Image
from sim.defects.lens import veiled
from sim.defects.world import World

_SPOT_AT, _SPOT_RADIUS = 0.06, 0.02  # of the picture's width: in the window, off its middle
_HOT_ELECTRONS_PER_S = 1e6  # of each pixel of the cluster
_DARK = 0.02  # of the light, in the shadow of a hand

FloatImage = NDArray[np.float32]


def scattered(light: FloatImage, world: World, lens: LensDefects, px_per_mm: float) -> FloatImage:
    """Return the picture of the lamp's light behind a hand and through a faulty lens.

    `lens`: its lasting defects; `world`: those of the moment. `px_per_mm`: scale at the axis.
    """
    if world.shadow:
        light = light.copy()
        light[:, : round(world.shadow * light.shape[1])] *= _DARK
    sigma_px = float(np.hypot(world.blur_mm * px_per_mm, lens.defocus_px))
    if sigma_px:
        light = np.asarray(cv2.GaussianBlur(light, (0, 0), sigma_px), dtype=np.float32)
    if lens.glare:
        light = veiled(light, lens.glare, lens.glare_width * light.shape[1])
    if world.glare:
        light = light + np.float32(world.glare) * light.mean()
    return light


def stray_electrons_per_s(world: World, camera: CameraConfig, white: float) -> FloatImage:
    """Return the electrons per second that come neither from the lamp nor from a sound sensor.

    `white`: electrons per second of white in the lamp's light.
    """
    shape = (camera.height_px, camera.width_px)
    stray = np.full(shape, world.lens * world.room * white, dtype=np.float32)
    row, column = round(camera.axis_row_px), round(camera.axis_column_px)
    if world.spot:
        width = camera.width_px
        centre = (column + round(_SPOT_AT * width), row)
        spot = cv2.circle(np.zeros(shape, np.float32), centre, round(_SPOT_RADIUS * width), 1.0, -1)
        stray += np.float32(world.lens * world.spot * white) * np.asarray(spot)
    stray[row : row + world.hot_px, column : column + world.hot_px] += _HOT_ELECTRONS_PER_S
    return stray


def distorted(image: Image, world: World, camera: CameraConfig) -> Image:
    """Return an image, (rows, columns) in counts, after a faulty converter."""
    counts = image.astype(np.float64)
    if world.gamma != 1.0:
        black = camera.black_level_dn
        share = np.maximum(counts - black, 0.0) / (camera.max_dn - black)
        counts = black + (camera.max_dn - black) * share**world.gamma
    counts = np.clip(np.rint(counts + world.black_dn), 0, camera.max_dn)
    whole = counts.astype(np.uint16)
    column = round(camera.axis_column_px)
    whole[:, column : column + world.dead_columns] = 0
    if world.stuck_bit >= 0:
        whole |= np.uint16(1 << world.stuck_bit)
    return whole.astype(np.uint8) if image.dtype == np.uint8 else whole


def mixed_up(
    image: Image, number: int, last: Image | None, world: World, camera: CameraConfig
) -> Image:
    """Return frame `number` (from 0) of a series as it arrives, (rows, columns) in counts.

    `last` is the frame before it.
    """
    old = world.frozen or (world.stale and number == 0) or (world.repeats and number == 2)
    if last is not None and old:
        return last.copy()
    if world.black_rows and number == 2:
        image = image.copy()
        image[-round(world.black_rows * camera.height_px) :] = 0
    return image
