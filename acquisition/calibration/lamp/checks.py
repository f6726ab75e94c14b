"""Refusal of readings that cannot calibrate a lamp: no light, saturation, a jump, a dead lamp."""

from __future__ import annotations

import numpy as np

from acquisition.calibration.checks import MOST_SATURATED, SATURATED
from acquisition.measure.drift import MIN_JUMP
from analysis.calibration.level_series import LevelSeries
from instrument.config.camera import CameraConfig
from instrument.devices import Frame
from instrument.errors import DeviceError, NotDetermined
from instrument.geometry import BoolArray, FloatArray

_LEAST_LIGHT = 0.05  # of full scale
_DEAD = 0.1  # of the light before: no lamp that is on loses more between two readings
_JUMP_U = 6.0  # times the noise of a second difference: none of 180 readings of 1000 calibrations
_MEDIAN = 1.5  # times a median deviation is a standard deviation; of two frames it is 1.5 too
_FEW = 6  # readings: with fewer of them the median of their scatter says too little
_AGAIN = "look at the lamp and its supply, and calibrate again. No file is written"


def require_light(lit_dn: float, dark_dn: float, exposure_s: float, camera: CameraConfig) -> None:
    """Raise `NotDetermined` if the window, in DN, shows no light of the lamp."""
    span = camera.max_dn - camera.black_level_dn
    if lit_dn - dark_dn >= _LEAST_LIGHT * span:
        return
    if dark_dn - camera.black_level_dn >= _LEAST_LIGHT * span:
        raise NotDetermined(
            f"lamp: the darks are not dark: the window shows {dark_dn:.4g} DN with the lamp "
            f"covered and {lit_dn:.4g} DN with it uncovered, at {exposure_s:g} s. Cover the lamp, "
            "or look at its shutter, darken the room, and calibrate again"
        )
    raise NotDetermined(
        f"lamp: no light on the tile: the window shows {lit_dn - dark_dn:.3g} DN above the dark at "
        f"{exposure_s:g} s; needed: {_LEAST_LIGHT * span:.3g} DN. Is the lamp on, the tile in its "
        "place, the lens open? See with gonio grab; or allow a longer max_exposure_s"
    )


def require_unsaturated(frames: list[Frame], patch: BoolArray, camera: CameraConfig) -> None:
    """Raise `NotDetermined` if pixels of the window (rows, columns) are saturated."""
    counts = frames[-1].image[patch]
    share = float(np.mean(counts >= SATURATED * camera.max_dn))
    if share > MOST_SATURATED:
        raise NotDetermined(
            f"lamp: {100 * share:.2g} % of the window's pixels are saturated at "
            f"{frames[-1].exposure_s:g} s; allowed: {100 * MOST_SATURATED:g} %. If its light has "
            "grown since the start, begin a minute later; else take less light, or lower "
            "min_exposure_s if the camera can do less"
        )


def require_lamp(readings: LevelSeries, signal_dn: FloatArray) -> None:
    """Raise `DeviceError` if the last reading shows a lamp that died or jumped.

    signal_dn: of all readings (n,). A warm-up changes by less from one reading to the next, so a
    jump is a change far above the one before, above noise, and above the usual unrest.
    """
    if signal_dn.size < 2:
        return
    before, last = signal_dn[-2:].tolist()
    if last < _DEAD * before:
        raise DeviceError(
            f"lamp: went out {readings.age_s[-1]:.0f} s after the start: the window fell from "
            f"{before:.4g} to {last:.4g} DN above the dark; {_AGAIN}"
        )
    changes = np.diff(signal_dn) / signal_dn[:-1]
    if changes.size < 2:
        return
    noise = np.sqrt(6) * _noise_dn(readings) / before  # of a second difference
    unrest = _MEDIAN * float(np.median(np.abs(np.diff(changes)))) if changes.size >= _FEW else 0.0
    limit = max(MIN_JUMP, _JUMP_U * noise, _JUMP_U * unrest) + 2 * abs(float(changes[-2]))
    if abs(changes[-1]) > limit:
        raise DeviceError(
            f"lamp: its light jumped by {100 * changes[-1]:+.3g} % between {readings.age_s[-2]:.0f}"
            f" and {readings.age_s[-1]:.0f} s after the start; expected: at most "
            f"{100 * limit:.2g} %. Did somebody pass, or touch the tile? Otherwise {_AGAIN}"
        )


def _noise_dn(readings: LevelSeries) -> float:
    """Return the noise of a reading in DN, by the scatter of its frames.

    The median is used, which a lamp that jumps within a reading does not move.
    """
    variances = readings.scatter_dn2 / readings.frames
    if variances.size < _FEW:
        freedom = float(np.sum(readings.frames - 1))
        return float(np.sqrt(variances.mean())) * (1 + 3 / freedom)  # few are often too small
    return _MEDIAN * float(np.sqrt(np.median(variances)))


def require_lit_tile(light: FloatArray, side_mm: float) -> None:
    """Raise `NotDetermined` if parts of the tile, cells (n,) of relative light, are dark."""
    least = float(light.min() / np.median(light))
    if least < 0.5:
        raise NotDetermined(
            f"lamp: within the tile's square of {side_mm:.3g} mm the light falls to "
            f"{100 * least:.2g} % of the usual; needed: 50 %. Give the size of the tile "
            "(--tile-mm), lay it on the axis, and look for a shadow (gonio grab)"
        )
