"""Refusal of frames that cannot calibrate a camera: light in darks, saturation, wrong exposures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acquisition.interlocks.darks import MOST_LIGHT
from analysis.calibration.camera_fit import CameraFit
from instrument.config.rig import Rig
from instrument.devices import Frame
from instrument.errors import DeviceError, NotDetermined

SATURATED = 0.98  # of the largest count
MOST_SATURATED = 0.001  # of the pixels: hot ones may be
_WARM = 20.0  # times the stated dark current, which is not known before it is calibrated
_STRONGEST_GAMMA = 2.4  # of video curves: that of sRGB above its linear part (IEC 61966-2-1)
_WANDER_DN = 2.0  # of the black level between exposures, and rounding
_MOST_DRIFT = 0.02  # during the levels: the fit takes off a steady drift, and warming up is none


def require_dark(darks: Sequence[Frame], rig: Rig) -> None:
    """Raise `NotDetermined` if darks rise with the exposure as no dark current does.

    `darks`: a frame of each exposure, rising. A gamma lifts dark counts; when the response is
    known, `require_no_lamp_in_darks` is stricter.
    """
    span = rig.camera.max_dn - rig.camera.black_level_dn
    levels = [float(np.median(frame.image)) for frame in darks]
    exposures = [frame.exposure_s for frame in darks]
    per_s = _WARM * rig.camera.dark_current_electrons_per_s
    per_s += MOST_LIGHT * rig.lamp.white_electrons_per_s
    for level, exposure_s in zip(levels[1:], exposures[1:], strict=True):
        share = per_s * (exposure_s - exposures[0]) / rig.camera.full_well_electrons
        limit = min(_WANDER_DN + span * share ** (1 / _STRONGEST_GAMMA), 0.9 * span)
        if level - levels[0] > limit:
            raise NotDetermined(
                f"camera: the darks are not dark: from {exposures[0]:g} to {exposure_s:g} s they "
                f"rise by {level - levels[0]:.4g} DN; expected: at most {limit:.3g} DN. Cover the "
                "lamp, or look at its shutter, darken the room, and calibrate again"
            )


def require_unsaturated(frames: Sequence[Frame], rig: Rig) -> None:
    """Raise `NotDetermined` if pixels of the flat field are saturated."""
    image, camera = frames[0].image, rig.camera
    count = int(np.count_nonzero(image >= SATURATED * camera.max_dn))
    if count > MOST_SATURATED * image.size:
        raise NotDetermined(
            f"camera: {count} of {image.size} pixels of the flat field are saturated at "
            f"{frames[0].exposure_s:g} s; allowed: {100 * MOST_SATURATED:g} %. Take less light, "
            "turn gloss out of the picture, or lower min_exposure_s if the camera can do less"
        )


def require_exposures(asked_s: Sequence[float], taken_s: Sequence[float]) -> None:
    """Raise `DeviceError` if a camera took fewer different exposures than asked, in seconds."""
    if len(taken_s) < len(asked_s):
        asked, taken = (", ".join(f"{e:g}" for e in values) for values in (asked_s, taken_s))
        raise DeviceError(
            f"camera: was asked for exposures of {asked} s and took {taken} s: correct "
            "min_exposure_s and max_exposure_s in the rig file, or switch off automatic exposure"
        )


def require_no_lamp_in_darks(fit: CameraFit, rig: Rig) -> None:
    """Raise `NotDetermined` if the darks hold more of the lamp's light than a scan tolerates."""
    full_per_s = fit.response.rate_per_s * rig.camera.full_well_electrons
    limit = MOST_LIGHT + _WARM * rig.camera.dark_current_electrons_per_s / full_per_s
    if fit.dark_light > limit:
        raise NotDetermined(
            f"camera: the darks are not dark: they rise with the exposure like "
            f"{100 * fit.dark_light:.3g} % of the lamp's light; allowed: {100 * limit:.3g} %. "
            "Cover the lamp, or look at its shutter, darken the room, and calibrate again"
        )


def require_steady(fit: CameraFit) -> None:
    """Raise `NotDetermined` if the lamp drifted while the levels were taken."""
    if abs(fit.drift) > _MOST_DRIFT:
        raise NotDetermined(
            f"camera: the lamp's light changed by {100 * fit.drift:+.2g} % during the levels; "
            f"allowed: {100 * _MOST_DRIFT:g} %. Let it warm up, and calibrate again"
        )
