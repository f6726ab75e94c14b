"""Search for the exposure at which a picture reaches a share of full scale."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from acquisition.calibration.checks import SATURATED
from acquisition.calibration.plan import nearest_s
from instrument.config.camera import CameraConfig

_STEPS = 6  # bisections: saturation is then known to 1 %


def exposure_reaching(
    share: float, measured: Callable[[float], float], camera: CameraConfig
) -> float:
    """Return the exposure in seconds at which the level that is `measured` reaches a share.

    The longest one, if none does. It is found by halving intervals, which no gamma misleads.
    """
    low, high = camera.min_exposure_s, camera.max_exposure_s
    if measured(low) >= share:
        return low
    while low < high and measured(min(4 * low, high)) < share:
        low = min(4 * low, high)
    high = min(4 * low, high)
    for _ in range(_STEPS):
        middle = nearest_s(float(np.sqrt(low * high)), camera)
        if not low < middle < high:
            break
        low, high = (middle, high) if measured(middle) < share else (low, middle)
    return low


def share_of_scale(level_dn: float, camera: CameraConfig) -> float:
    """Return a level in DN as a share of full scale, black taken off."""
    black = camera.black_level_dn
    return (level_dn - black) / (SATURATED * camera.max_dn - black)
