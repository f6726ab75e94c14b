"""Maps of a sensor's pixels: dark offset and dark current, hot pixels, PRNU and DSNU, flat field.

PRNU1288 and DSNU1288 of EMVA 1288, release 4.0 Linear, from high-passed pictures: the
light of a lamp on a surface, and the shading of a lens, are no property of the pixels. Defect
pixels are left out. All maps have the shape (rows, columns).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.calibration.level_series import (
    ROUNDING_DN2,
    Estimate,
    root_of,
    rounding_of_mean_dn,
)
from analysis.calibration.response_fit import ResponseFit
from instrument.geometry import BoolArray, FloatArray

_HIGH_PASS, _FLAT = 5, 15  # side of the squares of neighbours; 5 is that of the standard
_OUTLIER = 7.0  # times the scatter of the pixels: none of 10 million of a normal distribution
_LEAST_NEIGHBOURS = 10
_NORMAL_MAD = 1.4826  # standard deviation of a normal distribution by its median deviation


@dataclass(frozen=True, slots=True, kw_only=True)
class Stack:
    """Mean and temporal variance of each pixel over frames of one exposure, (rows, columns)."""

    exposure_s: float
    mean_dn: FloatArray
    variance_dn2: FloatArray
    frames: int

    def u_mean_dn(self) -> FloatArray:
        """Return the u of each pixel's mean (rows, columns) in DN: noise and rounding."""
        typical = np.full(1, float(np.median(self.variance_dn2)))
        noise = np.maximum(self.variance_dn2, ROUNDING_DN2) / self.frames
        return np.asarray(np.sqrt(noise + rounding_of_mean_dn(typical)[0] ** 2))


@dataclass(frozen=True, slots=True, kw_only=True)
class DarkMaps:
    """Dark counts of each pixel: offset_dn + current_dn_per_s * exposure, with u; hot pixels."""

    offset_dn: FloatArray
    current_dn_per_s: FloatArray
    u_offset_dn: FloatArray
    u_current_dn_per_s: FloatArray
    hot: BoolArray


@dataclass(frozen=True, slots=True, kw_only=True)
class FlatMaps:
    """Response to light of each pixel relative to its neighbours, with u; 1 where not measured.

    measured: pixels that were lit well. deviant: pixels that respond unlike all others, or not.
    """

    response: FloatArray
    u_response: FloatArray
    measured: BoolArray
    deviant: BoolArray


def dark_maps(short: Stack, long: Stack) -> DarkMaps:
    """Return the dark maps (rows, columns) from stacks in DN at two exposures in seconds."""
    apart_s = long.exposure_s - short.exposure_s
    current = (long.mean_dn - short.mean_dn) / apart_s
    u_current = np.hypot(long.u_mean_dn(), short.u_mean_dn()) / apart_s
    return DarkMaps(
        offset_dn=short.mean_dn - current * short.exposure_s,
        current_dn_per_s=current,
        u_offset_dn=np.hypot(short.u_mean_dn(), u_current * short.exposure_s),
        u_current_dn_per_s=u_current,
        hot=_above(current - _around(current), float(np.median(u_current))),
    )


def made_linear(stack: Stack, response: ResponseFit) -> Stack:
    """Return a stack, (rows, columns) in DN, on the scale that is linear in light, black at 0."""
    share = response.share(stack.mean_dn)
    return Stack(
        exposure_s=stack.exposure_s,
        mean_dn=response.curve.light(share) * response.span_dn,
        variance_dn2=stack.variance_dn2 * response.curve.gradient(share) ** 2,
        frames=stack.frames,
    )


def flat_maps(
    lit: Stack, dark_dn: FloatArray, measured: BoolArray, hot: BoolArray, response: ResponseFit
) -> FlatMaps:
    """Return the flat field from a stack in DN and the dark at its exposure, in DN.

    dark_dn, measured, hot: (rows, columns); measured is True where the surface fills the picture.
    """
    linear, used = made_linear(lit, response), measured & ~hot
    dark = response.curve.light(response.share(dark_dn)) * response.span_dn
    signal = linear.mean_dn - dark
    first, u = _relative(signal, linear, used)
    typical = float(np.median(u[used])) if used.any() else 0.0
    deviant = used & _above(np.abs(first - 1), typical, first[used] - 1)
    own, u = _relative(signal, linear, used & ~deviant)
    return FlatMaps(response=own, u_response=u, measured=used, deviant=deviant)


def _relative(signal: FloatArray, stack: Stack, used: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return the signal of each pixel relative to its neighbours, 1 where not used, and its u."""
    level = np.maximum(local_mean(signal, used, _FLAT)[0], 1e-9)
    return np.where(used, signal / level, 1.0), np.where(used, stack.u_mean_dn() / level, 0.0)


def dsnu(dark: Stack, used: BoolArray, gain_dn_per_electron: float) -> Estimate:
    """Return DSNU1288 in electrons from a dark stack in DN and the pixels used (rows, columns)."""
    spatial = _spatial_variance_dn2(dark.mean_dn, dark, used)
    return root_of(spatial, gain_dn_per_electron)


def prnu(lit: Stack, dark: Stack, used: BoolArray) -> Estimate:
    """Return PRNU1288, relative, from stacks in DN at one exposure; used: (rows, columns)."""
    signal = float(np.mean((lit.mean_dn - dark.mean_dn)[used]))
    bright = _spatial_variance_dn2(lit.mean_dn, lit, used)
    base = _spatial_variance_dn2(dark.mean_dn, dark, used)
    difference = Estimate(bright.value - base.value, float(np.hypot(bright.u, base.u)))
    return root_of(difference, signal)


def _spatial_variance_dn2(mean_dn: FloatArray, stack: Stack, used: BoolArray) -> Estimate:
    """Return the variance over pixels of a high-passed mean, temporal noise taken off."""
    around, count = local_mean(mean_dn, used, _HIGH_PASS)
    counted = used & (count >= _LEAST_NEIGHBOURS)
    rest = (mean_dn - around)[counted] / np.sqrt(1 - 1 / count[counted])
    temporal = float(np.mean(stack.variance_dn2[counted])) / stack.frames
    measured = float(np.mean(rest**2))
    rounding = float(rounding_of_mean_dn(np.full(1, np.median(stack.variance_dn2)))[0]) ** 2
    u = float(np.hypot(measured * np.sqrt(2 / max(rest.size, 1)), rounding))
    return Estimate(measured - temporal, u)


def local_mean(values: FloatArray, used: BoolArray, side: int) -> tuple[FloatArray, FloatArray]:
    """Return the mean of the used pixels in a square around each, in their unit, and their number.

    values, used: (rows, columns). side: of the square, in pixels.
    """
    import cv2

    weights = used.astype(np.float64)
    size = (side, side)
    edge = cv2.BORDER_CONSTANT
    total = cv2.boxFilter(values * weights, -1, size, normalize=False, borderType=edge)
    count = cv2.boxFilter(weights, -1, size, normalize=False, borderType=edge)
    count = np.maximum(np.rint(count), 1.0)
    return np.asarray(total / count), np.asarray(count)


def _around(values: FloatArray) -> FloatArray:
    """Return the median of the pixels around each one: the glow of an amplifier is even there."""
    import cv2

    return np.asarray(cv2.medianBlur(values.astype(np.float32), _HIGH_PASS), dtype=np.float64)


def _above(values: FloatArray, least_scatter: float, sample: FloatArray | None = None) -> BoolArray:
    """Return True for values far above the scatter of a sample, by default of all values."""
    of = values if sample is None else sample
    middle = float(np.median(of))
    scatter = _NORMAL_MAD * float(np.median(np.abs(of - middle)))
    return np.asarray(values - middle > _OUTLIER * max(scatter, least_scatter))
