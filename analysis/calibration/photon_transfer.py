"""Photon transfer: gain, dark noise, dark current and saturation from means and variances.

Method and definitions of EMVA 1288, release 4.0 Linear; with u from sampling,
rounding to counts and the response curve. Counts are first made linear with that curve: for a
linear camera this changes nothing, for others the standard's equations would not hold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.calibration.level_series import (
    ROUNDING_DN2,
    Estimate,
    LevelSeries,
    rounding_of_mean_dn,
    rounding_of_variance_dn2,
    saturation_index,
)
from analysis.calibration.response_fit import ResponseFit
from instrument.geometry import BoolArray, FloatArray, IntArray

_SENSITIVITY = 0.7  # of the saturation: the range of the standard for the gain
_NOISE = 4.0  # standard deviations within which a limit cuts off noise
_ROUNDS = 4  # of the fit, whose weights depend on its result
LEAST_NOISE_DN2 = 0.24  # by the standard: below it rounding rules the dark noise


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotonTransfer:
    """Properties of a sensor; None for what the data cannot determine.

    gain_dn_per_electron: K. dark_noise_electrons: sigma_d at exposure 0. dark_current_electrons_
    per_s: mu_I.mean. saturation_electrons: mu_e.sat, at the largest variance. full_well_electrons:
    where counts stop to rise, of the well or of the converter. dark_dn: level at exposure 0.
    """

    gain_dn_per_electron: Estimate
    dark_noise_electrons: Estimate | None
    dark_current_electrons_per_s: Estimate | None
    saturation_electrons: Estimate | None
    full_well_electrons: Estimate | None
    dark_dn: Estimate
    dark_noise_is_rounding: bool
    chi2_per_point: float


def linear_variance_dn2(lit: LevelSeries, response: ResponseFit) -> FloatArray:
    """Return the variances (exposures,) in DN² of counts that were made linear."""
    slope = response.curve.gradient(response.share(lit.mean_dn))
    return np.asarray(lit.variance_dn2 * slope**2, dtype=np.float64)


def dark_line(dark: LevelSeries, u_mean_dn: FloatArray) -> tuple[Estimate, Estimate]:
    """Return the dark level at exposure 0 in DN and its rise in DN/s.

    u_mean_dn: u of each mean (exposures,) in DN.
    """
    matrix = np.stack([np.ones_like(dark.exposure_s), dark.exposure_s], axis=1)
    values, covariance, _ = _line(matrix, dark.mean_dn, np.diag(u_mean_dn**2))
    u = np.sqrt(np.diag(covariance))
    # Rounding may shift all short exposures by one error and all long ones by another.
    rounding = float(rounding_of_mean_dn(dark.variance_dn2).max())
    u_zero = float(np.hypot(u[0], rounding))
    u_rise = float(np.hypot(u[1], np.sqrt(2) * rounding / np.ptp(dark.exposure_s)))
    return Estimate(float(values[0]), u_zero), Estimate(float(values[1]), u_rise)


def photon_transfer(
    lit: LevelSeries, dark: LevelSeries, response: ResponseFit, u_dark_dn: FloatArray
) -> PhotonTransfer:
    """Return the sensor's properties from levels in the order of rising exposure.

    u_dark_dn: u of the mean of each dark (exposures,) in DN.
    """
    zero, rise = dark_line(dark, u_dark_dn)
    gain, variance, covariance, chi2 = _gain(lit, dark, response, zero.value)
    u_curve = _by_curve(lit, dark, response, zero.value, gain)
    u_gain = float(np.hypot(np.sqrt(covariance[0, 0]), u_curve))
    k = Estimate(gain, u_gain)
    saturation, full_well = _saturation(lit, response, zero.value, k)
    return PhotonTransfer(
        gain_dn_per_electron=k,
        dark_noise_electrons=None
        if response.curve.is_video
        else _dark_noise(variance, covariance, k),
        dark_current_electrons_per_s=_dark_current(rise, zero.value, response, k),
        saturation_electrons=saturation,
        full_well_electrons=full_well,
        dark_dn=zero,
        dark_noise_is_rounding=bool(np.median(dark.variance_dn2) < LEAST_NOISE_DN2),
        chi2_per_point=chi2,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Points:
    """Variances in DN² over signals in DN, (points,), both in linear counts.

    slope: of linear counts by counts. freedom: degrees of freedom of each variance. dark: True for
    a level without light.
    """

    signal: FloatArray
    variance: FloatArray
    slope: FloatArray
    freedom: FloatArray
    dark: BoolArray

    def covariance(self, counts_dn2: FloatArray) -> FloatArray:
        """Return the covariance of the variances, where those of the counts are `counts_dn2`.

        Darks share what rounding leaves open, where their level is the same at all exposures.
        """
        sampling = counts_dn2 * np.sqrt(2 / self.freedom) * self.slope**2
        rounding = rounding_of_variance_dn2(counts_dn2) * self.slope**2
        shared = np.where(self.dark, rounding, 0.0)
        own = np.diag(sampling**2 + rounding**2) + np.outer(shared, shared)
        return np.asarray(own, dtype=np.float64)


def _gain(
    lit: LevelSeries, dark: LevelSeries, response: ResponseFit, dark_dn: float
) -> tuple[float, float, FloatArray, float]:
    """Fit variance = c + K signal; return K, c, their covariance and chi² a point."""
    points = _points(lit, dark, response, dark_dn)
    matrix = np.stack([points.signal, np.ones_like(points.signal)], axis=1)
    expected = points.variance
    for _ in range(_ROUNDS):
        counts_dn2 = np.maximum(expected, 0.0) / points.slope**2 + ROUNDING_DN2
        covariance = points.covariance(counts_dn2)
        values, own, chi2 = _line(matrix, points.variance, covariance)
        expected = matrix @ values
    return float(values[0]), float(values[1]), own, chi2


def _below_limit(lit: LevelSeries, response: ResponseFit) -> IntArray:
    """Return the indices of the lit levels up to the limit of the standard.

    Behind a gamma levels near black do not count: noise below black is cut off there.
    """
    signal = response.light(lit.mean_dn, lit.variance_dn2)
    variance = linear_variance_dn2(lit, response)
    last = saturation_index(variance)
    below = (signal <= _SENSITIVITY * signal[last]) & (np.arange(signal.size) <= last)
    if response.curve.is_video:
        below &= signal * response.span_dn > _NOISE * np.sqrt(variance)
    return np.flatnonzero(below)


def _points(lit: LevelSeries, dark: LevelSeries, response: ResponseFit, dark_dn: float) -> _Points:
    """Return lit levels up to the limit of the standard, and darks, but no darks behind a gamma."""
    lit = lit.chosen(_below_limit(lit, response))
    series = [lit] if response.curve.is_video else [lit, dark]
    mean, variance, frames, pixels = (
        np.concatenate(parts)
        for parts in zip(
            *((s.mean_dn, s.variance_dn2, s.frames, 0 * s.frames + s.pixels) for s in series),
            strict=True,
        )
    )
    slope = response.curve.gradient(response.share(mean))
    base = response.curve.light(response.share(np.array([dark_dn])))[0]
    return _Points(
        signal=(response.light(mean, variance) - base) * response.span_dn,
        variance=(variance - ROUNDING_DN2) * slope**2,
        slope=slope,
        freedom=pixels * (frames - 1),
        dark=np.arange(mean.size) >= series[0].mean_dn.size,
    )


def _line(
    matrix: FloatArray, values: FloatArray, covariance: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Return the weighted least-squares solution, its covariance and chi² a degree of freedom."""
    size = np.sqrt(np.diag(covariance))
    root = np.linalg.cholesky(covariance / np.outer(size, size))
    weighted = np.linalg.solve(root, matrix / size[:, None])
    own = np.linalg.inv(weighted.T @ weighted)
    found = own @ (weighted.T @ np.linalg.solve(root, values / size))
    rest = np.linalg.solve(root, values / size) - weighted @ found
    chi2 = float(rest @ rest) / max(values.size - found.size, 1)
    return found.astype(np.float64), own.astype(np.float64) * max(1.0, chi2), chi2


def _by_curve(
    lit: LevelSeries, dark: LevelSeries, response: ResponseFit, dark_dn: float, gain: float
) -> float:
    """Return the u that the response curve's parameters give the gain, in DN per electron."""
    size = np.sqrt(np.diag(response.covariance))
    changes = np.zeros(size.size)
    for i, step in enumerate(size):
        if step and i not in (1, 2):  # the gain does not depend on light and drift
            steps = np.where(np.arange(size.size) == i, step, 0.0)
            moved = _gain(lit, dark, response.moved(steps), dark_dn)[0]
            changes[i] = (moved - gain) / step
    return float(np.sqrt(max(float(changes @ response.covariance @ changes), 0.0)))


def _dark_noise(variance: float, covariance: FloatArray, gain: Estimate) -> Estimate:
    """Return sigma_d in electrons; where its variance may be 0, the middle of what is possible."""
    u = float(np.sqrt(covariance[1, 1]))
    k = gain.value
    if variance > 2 * u:
        root = float(np.sqrt(variance))
        by_k = float(covariance[0, 1] / (root * k**2))  # of K and variance together
        u2 = (u / (2 * root * k)) ** 2 + (root * gain.u / k**2) ** 2 - by_k * root / k
        return Estimate(root / k, float(np.sqrt(max(u2, 0.0))))
    most = float(np.sqrt(max(variance, 0.0) + 2 * u)) / k
    return Estimate(most / 2, most / np.sqrt(12))


def _dark_current(
    rise: Estimate, dark_dn: float, response: ResponseFit, gain: Estimate
) -> Estimate | None:
    """Return mu_I in electrons/s; None behind a gamma, where dark counts are not linear."""
    if response.curve.is_video:
        return None
    slope = float(response.curve.gradient(response.share(np.array([dark_dn])))[0])
    value = rise.value * slope / gain.value
    u = np.hypot(rise.u * slope / gain.value, value * gain.u / gain.value)
    return Estimate(value, float(u))


def _saturation(
    lit: LevelSeries, response: ResponseFit, dark_dn: float, gain: Estimate
) -> tuple[Estimate | None, Estimate | None]:
    """Return mu_e.sat and the full well in electrons; None where the camera did not saturate."""
    last = saturation_index(linear_variance_dn2(lit, response))
    if last + 1 >= lit.mean_dn.size:
        return None, None
    span, exposure_s = response.span_dn, lit.exposure_s
    reached = response.rate_per_s * float(exposure_s[last]) * span / gain.value
    # The largest variance lies between the neighbours of the exposure that has it.
    step = float(exposure_s[last + 1] - exposure_s[max(last - 1, 0)]) / 2 / float(exposure_s[last])
    relative = float(np.hypot(gain.u / gain.value, step / np.sqrt(3)))
    end = float(lit.mean_dn[-1])
    if end + _NOISE * float(np.sqrt(lit.variance_dn2[last])) > response.max_dn:
        end = response.max_dn  # the converter's limit, which cuts off half of the noise
    top = response.light(np.array([end])) - response.light(np.array([dark_dn]))
    full = float(top[0]) * span / gain.value
    u_full = full * float(np.hypot(gain.u / gain.value, response.u_light_relative))
    return Estimate(reached, reached * relative), Estimate(full, u_full)
