"""Error of the mean of counts that a camera has rounded to whole numbers.

Noise dithers the rounding: a mean of many counts is off by the first terms of a Fourier series in
the level, each damped by the noise (Widrow and Kollar, Quantization Noise, 2008, chapters 4 and 5).
With noise of 0.25 counts the error is up to 0.09 counts. It depends on the level alone, so that no
number of frames or pixels averages it out; but mean and variance of the counts determine both the
level and the noise, and so the error.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from instrument.geometry import FloatArray

# Noise variances in DN^2 among which that of a dark is sought: above, rounding has no effect; below
# the least all pixels round alike.
_VARIANCES = np.geomspace(0.05**2, 0.9**2, 60)
_LEVELS = np.linspace(-1.0, 1.0, 801)  # in DN
_TERMS = np.arange(1, 21)
_MOST_TERMS = 1999
_UNDERFLOW = math.sqrt(745.2) / (2 * math.pi)  # exp(-745.2) is 0 in double precision
_FAR_DN = 1.5  # from the median: a defective pixel, which says nothing about the noise of others
_ENOUGH = 1000  # pixels for that median: it is off by a hundredth of a count


def rounding_u_dn(noise_variance_dn2: float) -> float:
    """Return the error (standard deviation, DN) of the mean of many counts rounded to integers.

    Without noise every pixel rounds alike: 1/sqrt(12) DN. Normal noise of variance s^2 damps the
    k-th term of the sawtooth error's Fourier series by exp(-2 pi^2 k^2 s^2). Averaged over all
    levels.
    """
    terms = _MOST_TERMS
    if noise_variance_dn2 > 0:  # the exponentials of more are 0
        terms = min(terms, math.ceil(_UNDERFLOW / math.sqrt(noise_variance_dn2)))
    k = np.arange(1, terms + 1)
    damped = np.exp(-4 * np.pi**2 * k**2 * noise_variance_dn2) / (2 * np.pi**2 * k**2)
    return float(np.sqrt(damped.sum()))


def rounded_normal(level: FloatArray, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return error of the mean (DN) and variance (DN^2) of rounded normal counts.

    `level` in DN and `variance` in DN^2, before rounding, broadcast to the results' shape.
    """
    level, variance = np.asarray(level)[..., None], np.asarray(variance)[..., None]
    k = _TERMS
    damped = np.where(k % 2, -1.0, 1.0) * np.exp(-2 * (np.pi * k) ** 2 * variance)
    error = np.sum(damped * np.sin(2 * np.pi * k * level) / (np.pi * k), axis=-1)
    wave = damped * np.cos(2 * np.pi * k * level) * (1 / (np.pi * k) ** 2 + 4 * variance)
    rounded: FloatArray = variance[..., 0] + 1 / 12 + wave.sum(axis=-1) - error**2
    return error, rounded


def dark_rounding_dn(
    mean: FloatArray, variance: FloatArray, weights: FloatArray, frames: int
) -> tuple[float, float]:
    """Return the error of a dark's weighted mean by rounding, and its standard uncertainty, in DN.

    `mean` in DN and frame-to-frame `variance` in DN^2 of each pixel, over `frames`, and the weights
    of a window, (rows, columns) each. The counts are taken as normally distributed. Where pixels
    differ in offset that need not be so: the part of their differences in the spread of all counts
    is taken of the error that the noise of one pixel would leave.
    """
    step = max(1, mean.size // _ENOUGH)
    some = mean.ravel()[::step][weights.ravel()[::step] > 0]
    typical = np.partition(some, some.size // 2)[some.size // 2] if some.size else 0.0
    far = np.abs(mean - typical) >= _FAR_DN
    part = np.where(far, 0.0, weights) if far.any() else weights
    if not part.any():
        return 0.0, 0.0
    part = part / part.sum()
    level = float(np.vdot(part, mean))
    between = float(np.vdot(part, np.square(mean - level)))
    temporal = float(np.vdot(part, variance))
    total = between + temporal * (frames - 1) / frames
    if total > 1.0:
        return 0.0, 0.0
    error, u_error, noise = _normal_error(level, total, frames / float(np.vdot(part, part)))
    pattern = max(between - temporal / frames, 0.0)
    u_pattern = rounding_u_dn(max(noise - pattern, 0.0)) * np.sqrt(pattern / max(total, 1e-9))
    return error, float(np.hypot(u_error, u_pattern))


def _normal_error(mean: float, variance: float, samples: float) -> tuple[float, float, float]:
    """Return error of a mean of rounded normal counts, its standard uncertainty, and the noise.

    The noise is the variance before rounding. Each of `_VARIANCES` has a level with this mean;
    among these is the one with this variance, or rather with its excess over that of the two
    nearest counts alone, which has little sampling error. The uncertainty is half the range that
    the sampling errors of mean and excess allow, one count included.
    """
    above = mean - np.floor(mean)
    excess = max(variance - above * (1 - above), 0.0)
    u_mean = np.sqrt(variance / samples) + 1 / samples
    u_excess = 2 * np.sqrt((excess + 1 / samples) / samples)
    means = above - np.rint(above) + u_mean * np.array([-1.0, 1.0])
    possible = excess + u_excess * np.array([-1.0, 1.0])
    rows = list(zip(*_table(), strict=True))
    levels = np.array([np.interp(means, of_level, _LEVELS) for of_level, _ in rows])
    rounded = np.array([np.interp(means, of_level, v) for of_level, v in rows])
    errors = [
        np.interp(possible, e, m - level)
        for m, level, e in zip(means, levels.T, rounded.T, strict=True)
    ]
    noise = float(np.interp(excess, rounded.mean(axis=1), _VARIANCES))
    low, high = float(np.min(errors)), float(np.max(errors))
    return (low + high) / 2, (high - low) / 2, noise


@lru_cache(maxsize=1)
def _table() -> tuple[FloatArray, FloatArray]:
    """Return mean and excess variance of rounded counts, (variances, levels), in DN and DN^2."""
    error, rounded = rounded_normal(_LEVELS, _VARIANCES[:, np.newaxis])
    mean = np.maximum.accumulate(_LEVELS + error, axis=1)
    above = mean - np.floor(mean)
    return mean, rounded - above * (1 - above)
