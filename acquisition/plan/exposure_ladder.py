"""Which exposure to use: a ladder of exposures, and the step of it that a brightness asks for.

A ladder keeps the number of different exposures small, and with it the number of darks.
"""

from __future__ import annotations

import math

from instrument.config.camera import CameraConfig
from instrument.config.protocol import Protocol
from instrument.config.rig import Rig

STEP = math.sqrt(2.0)
NEARLY_FULL = 0.97  # of full scale: beyond this the response is not trusted


def exposure_ladder_s(camera: CameraConfig) -> tuple[float, ...]:
    """Every exposure that is ever used, in seconds: the camera's shortest times powers of sqrt 2.

    Rounded to the camera's own steps, or to six digits, so that the same exposure always is the
    same number.
    """
    top = math.floor(math.log(camera.max_exposure_s / camera.min_exposure_s, STEP) + 1e-9)
    ideal = (camera.min_exposure_s * STEP**n for n in range(top + 1))
    step_s = camera.exposure_step_s
    exact = (round(e / step_s) * step_s if step_s else e for e in ideal)
    return tuple(dict.fromkeys(float(f"{e:.6g}") for e in exact))


def longest_below(limit_s: float, camera: CameraConfig) -> float:
    """The longest exposure of the ladder up to `limit_s`, or the shortest there is."""
    ladder = exposure_ladder_s(camera)
    return max((e for e in ladder if e <= limit_s * (1 + 1e-9)), default=ladder[0])


def expected_exposure_s(
    theta_i_deg: float, reflectance: float, protocol: Protocol, rig: Rig
) -> float:
    """A first guess, in seconds: a diffuser of that reflectance reaches the exposure target."""
    rate = rig.lamp.white_electrons_per_s * reflectance
    rate *= max(math.cos(math.radians(theta_i_deg)), 0.05)
    target = protocol.exposure_target * rig.camera.full_well_electrons
    return longest_below(target / rate, rig.camera)
