"""Evaluation of a camera's levels: response, photon transfer and linearity error together.

What keeps the levels from determining a camera raises `NotDetermined` with what to change.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.calibration.level_series import (
    Estimate,
    LevelSeries,
    flicker,
    saturation_index,
    unsaturated,
)
from analysis.calibration.linearity_error import LinearityError, linearity_error
from analysis.calibration.photon_transfer import (
    PhotonTransfer,
    linear_variance_dn2,
    photon_transfer,
)
from analysis.calibration.response_fit import ResponseFit, fit_response
from instrument.errors import NotDetermined
from instrument.geometry import IntArray

LEAST_LEVELS = 6  # below saturation: three common parameters, two of a bend, and one to judge them
_LEAST_TOP = 0.5  # of full scale, reached by the brightest level: a response is not extrapolated
_LEAST_RISE = 0.2  # of the ratio of exposures, in logarithms: a gamma of 2.2 has 0.45
_LEAST_VARIANCE_DN2 = 0.02  # of the noisiest level: a well of a million electrons at 8 bit has 0.06
_LEAST_GAIN = 5.0  # times its u
_DENOISED = (
    "Switch off noise reduction and compression, choose a pixel_format of more bits, or take more "
    "frames (--frames)"
)
_LAMP_IN_DARKS = 0.3  # of the rise of lit levels: no dark current comes near it


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraFit:
    """Result for a camera.

    flicker: relative, of the lamp from frame to frame. black_wander_dn: of the black level, from
    frame to frame. dark_light: largest share of the lamp's light that may be in the darks.
    drift: relative change of the lamp during the lit levels.
    """

    response: ResponseFit
    transfer: PhotonTransfer
    linearity: LinearityError
    flicker: float
    black_wander_dn: float
    dark_light: float
    drift: float


def fit_camera(lit: LevelSeries, dark: LevelSeries, max_dn: float) -> CameraFit:
    """Return the properties of a camera from lit and dark levels, exposures in rising order."""
    dark_dn = float(dark.mean_dn[0])
    _require_darkness(lit, dark)
    _require_rise(lit, max_dn, dark_dn)
    usable = np.flatnonzero(unsaturated(lit, max_dn, dark_dn))
    _require_levels(lit, usable, max_dn, dark_dn)
    relative, wander = flicker(lit.chosen(usable), dark)
    fitted = lit.chosen(usable)
    common = (wander**2 + (relative * (fitted.mean_dn - dark_dn)) ** 2) / fitted.frames
    response = fit_response(fitted, np.sqrt(fitted.u_mean_dn() ** 2 + common), max_dn, dark_dn)
    _require_variance(fitted)
    u_dark = np.sqrt(dark.u_mean_dn() ** 2 + wander**2 / dark.frames)
    transfer = photon_transfer(lit, dark, response, u_dark)
    _require_gain(transfer.gain_dn_per_electron)
    dark_at = np.interp(lit.exposure_s, dark.exposure_s, dark.mean_dn)
    top = saturation_index(linear_variance_dn2(lit, response))
    return CameraFit(
        response=response,
        transfer=transfer,
        linearity=linearity_error(lit, dark_at, top),
        flicker=relative,
        black_wander_dn=wander,
        dark_light=_dark_light(dark, response),
        drift=response.drift_per_s * float(np.ptp(fitted.age_s)),
    )


def _require_darkness(lit: LevelSeries, dark: LevelSeries) -> None:
    """Refuse darks that rise with the exposure nearly as the lit levels do."""
    at = np.interp(lit.exposure_s, dark.exposure_s, dark.mean_dn)
    rise, base = lit.mean_dn - at[0], at - at[0]
    worst = int(np.argmax(base))
    if base[worst] > _LAMP_IN_DARKS * max(float(rise[worst]), 1.0):
        raise NotDetermined(
            f"camera: the darks are not dark: at {lit.exposure_s[worst]:g} s they rise by "
            f"{base[worst]:.4g} DN, the lit frames by {rise[worst]:.4g} DN. Cover the lamp, or "
            "close its shutter, and calibrate again"
        )


def _require_rise(lit: LevelSeries, max_dn: float, dark_dn: float) -> None:
    """Refuse counts that do not follow the exposure."""
    below = np.flatnonzero(lit.mean_dn < dark_dn + 0.9 * (max_dn - dark_dn))
    if below.size < 2:
        return
    first, last = int(below[0]), int(below[-1])
    signal = np.maximum(lit.mean_dn - dark_dn, 1e-3)
    expected = float(np.log(lit.exposure_s[last] / lit.exposure_s[first]))
    if float(np.log(signal[last] / signal[first])) < _LEAST_RISE * expected:
        raise NotDetermined(
            f"camera: its counts do not follow the exposure: from {lit.exposure_s[first]:g} to "
            f"{lit.exposure_s[last]:g} s the signal goes from {signal[first]:.4g} to "
            f"{signal[last]:.4g} DN. Switch off automatic exposure and gain; check the exposures "
            "that the camera can take, and the light"
        )


def _require_levels(lit: LevelSeries, usable: IntArray, max_dn: float, dark_dn: float) -> None:
    """Refuse levels that are too few, or too dark."""
    if usable.size < LEAST_LEVELS:
        raise NotDetermined(
            f"camera: {usable.size} of {lit.mean_dn.size} exposures are below saturation; needed: "
            f"{LEAST_LEVELS} or more. Take less light, or more exposures (--exposures)"
        )
    signal = lit.mean_dn[usable] - dark_dn
    top = float(signal[-1]) / (max_dn - dark_dn)
    if top < _LEAST_TOP:
        raise NotDetermined(
            f"camera: the longest exposure without saturation, {lit.exposure_s[usable[-1]]:g} s, "
            f"reaches {100 * top:.3g} % of full scale; needed: {100 * _LEAST_TOP:g} %. More light, "
            "a longer max_exposure_s, or more exposures (--exposures)"
        )


def _require_variance(lit: LevelSeries) -> None:
    """Refuse levels without noise."""
    most = float(lit.variance_dn2.max())
    if most < _LEAST_VARIANCE_DN2:
        raise NotDetermined(f"camera: its frames have no noise ({most:.2g} DN²). {_DENOISED}")


def _require_gain(gain: Estimate) -> None:
    """Refuse noise that does not rise with the light as photons demand."""
    if not gain.value > _LEAST_GAIN * gain.u:
        raise NotDetermined(
            f"camera: the noise does not rise with the light: gain {gain.value:.2g} ± {gain.u:.2g} "
            f"DN per electron. {_DENOISED}"
        )


def _dark_light(dark: LevelSeries, response: ResponseFit) -> float:
    """Return the rise of the darks per second over that of the lit levels."""
    light = response.light(dark.mean_dn, dark.variance_dn2)
    per_s = (light[-1] - light[0]) / (dark.exposure_s[-1] - dark.exposure_s[0])
    return float(per_s / response.rate_per_s)
