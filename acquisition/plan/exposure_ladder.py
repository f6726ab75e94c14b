"""Ladder of allowed exposure times, and the rung that a brightness calls for.

Few different exposures need few dark frames.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from instrument.config.camera import CameraConfig
from instrument.config.protocol import Protocol
from instrument.config.rig import Rig
from instrument.geometry import FloatArray

LADDER_RATIO = math.sqrt(2.0)


def exposure_ladder_s(camera: CameraConfig) -> tuple[float, ...]:
    """Return all allowed exposures in seconds: the camera's shortest times powers of sqrt 2.

    Each is rounded to the camera's exposure step, or to six digits, so that equal exposures
    compare equal.
    """
    ratio = camera.max_exposure_s / camera.min_exposure_s
    top = math.floor(math.log(ratio, LADDER_RATIO) + 1e-9)
    ideal = (camera.min_exposure_s * LADDER_RATIO**n for n in range(top + 1))
    step_s = camera.exposure_step_s
    exact = (round(e / step_s) * step_s if step_s else e for e in ideal)
    return tuple(dict.fromkeys(float(f"{e:.6g}") for e in exact))


def longest_exposure_s(
    limit_s: float, camera: CameraConfig, taken_s: Mapping[float, float] | None = None
) -> float:
    """Return the rung of the ladder with the longest exposure up to `limit_s`, or else its lowest.

    `taken_s`: exposures that the camera took, by the rung that was asked for, where they differ.
    """
    ladder, taken = exposure_ladder_s(camera), taken_s or {}
    allowed = [rung for rung in ladder if taken.get(rung, rung) <= limit_s * (1 + 1e-9)]
    return max(allowed, key=lambda rung: taken.get(rung, rung), default=ladder[0])


def longest_exposures_s(limits_s: FloatArray, camera: CameraConfig) -> FloatArray:
    """Return the rung for each of the limits (N,), in seconds, as `longest_exposure_s` does."""
    ladder = np.sort(exposure_ladder_s(camera))
    places = np.searchsorted(ladder, limits_s * (1 + 1e-9), side="right") - 1
    return np.asarray(ladder[np.maximum(places, 0)])


def expected_exposure_s(
    theta_i_deg: float, reflectance: float, protocol: Protocol, rig: Rig
) -> float:
    """Return the exposure in seconds at which a diffuser of that reflectance reaches the target."""
    rate = rig.lamp.white_electrons_per_s * reflectance
    rate *= max(math.cos(math.radians(theta_i_deg)), 0.05)
    target = protocol.exposure_target * rig.camera.full_well_electrons
    return longest_exposure_s(target / rate, rig.camera)
