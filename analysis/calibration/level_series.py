"""Means and temporal variances of a patch of pixels at several exposures, lit or dark."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from instrument.geometry import BoolArray, FloatArray, IntArray

ROUNDING_DN2 = 1 / 12  # variance of rounding to whole counts, sigma_q squared of EMVA 1288
_BELOW_TOP, _NOISE = 0.95, 5.0  # of the range and times the noise: counts that no limit has cut off
_LEVEL = 0.002  # of the range: two means so close, at exposures further apart, are at the limit


class Estimate(NamedTuple):
    """Value with its standard uncertainty."""

    value: float
    u: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelSeries:
    """Levels by exposure; arrays have the shape (exposures,).

    exposure_s, mean_dn: of the patch. variance_dn2: temporal variance of a pixel, averaged over the
    patch, without what is common to a frame. scatter_dn2: variance of the frames' means. frames:
    number of frames at each exposure. age_s: time of each, from the first. pixels: of the patch.
    """

    exposure_s: FloatArray
    mean_dn: FloatArray
    variance_dn2: FloatArray
    scatter_dn2: FloatArray
    frames: FloatArray
    age_s: FloatArray
    pixels: int

    def chosen(self, which: IntArray) -> LevelSeries:
        """Return the levels with these indices, an array (n,); the units stay the same."""
        arrays = (self.exposure_s, self.mean_dn, self.variance_dn2, self.scatter_dn2)
        exposure_s, mean, variance, scatter = (values[which] for values in arrays)
        return LevelSeries(
            exposure_s=exposure_s, mean_dn=mean, variance_dn2=variance, scatter_dn2=scatter,
            frames=self.frames[which], age_s=self.age_s[which], pixels=self.pixels,
        )  # fmt: skip

    def u_variance_dn2(self) -> FloatArray:
        """Return the u of each variance (exposures,) in DN squared, by sampling."""
        relative = np.sqrt(2 / (self.pixels * (self.frames - 1)))
        return np.asarray(self.variance_dn2 * relative, dtype=np.float64)

    def u_mean_dn(self) -> FloatArray:
        """Return the u of each mean (exposures,) in DN, of pixel noise and rounding to counts."""
        noise = self.variance_dn2 / (self.pixels * self.frames)
        rounding = rounding_of_mean_dn(self.variance_dn2)
        return np.asarray(np.sqrt(noise + rounding**2), dtype=np.float64)


def rounding_of_mean_dn(variance_dn2: FloatArray) -> FloatArray:
    """Return the u in DN that rounding gives a mean of counts of this variance (n,) in DN².

    First term of the Fourier series of the rounding error, which noise damps (Widrow and Kollár,
    Quantization Noise, 2008, ch. 5); the mean's place between two counts is unknown.
    """
    return np.asarray(_damping(variance_dn2) / (np.pi * np.sqrt(2)), dtype=np.float64)


def rounding_of_variance_dn2(variance_dn2: FloatArray) -> FloatArray:
    """Return the u that rounding leaves in a variance (n,), both in DN squared, beside 1/12."""
    noise = np.maximum(variance_dn2 - ROUNDING_DN2, 0.0)
    open_dn2 = (4 * noise + 1 / np.pi**2) * _damping(variance_dn2) / np.sqrt(2)
    return np.asarray(open_dn2, dtype=np.float64)


def _damping(variance_dn2: FloatArray) -> FloatArray:
    noise = np.maximum(variance_dn2 - ROUNDING_DN2, 0.0)
    return np.asarray(np.exp(-2 * np.pi**2 * noise), dtype=np.float64)


def flicker(lit: LevelSeries, dark: LevelSeries) -> tuple[float, float]:
    """Return the lamp's relative flicker from frame to frame, and the black level's wander in DN.

    Both series have the shape (exposures,), in DN: standard deviations from the frames' means.
    """
    wander2 = max(float(np.mean(dark.scatter_dn2 - dark.variance_dn2 / dark.pixels)), 0.0)
    signal = lit.mean_dn - float(dark.mean_dn.min())
    own = lit.scatter_dn2 - lit.variance_dn2 / lit.pixels - wander2
    relative2 = float(np.mean(own / np.maximum(signal, 1.0) ** 2))
    return float(np.sqrt(max(relative2, 0.0))), float(np.sqrt(wander2))


def flicker_estimate(lit: LevelSeries, wander_dn: float, dark_dn: float) -> Estimate:
    """Return the lamp's relative flicker from frame to frame with its u, from levels (exposures,).

    wander_dn: of the black level, from frame to frame. dark_dn: level without light.
    """
    signal2 = np.maximum(lit.mean_dn - dark_dn, 1.0) ** 2
    own = lit.scatter_dn2 - lit.variance_dn2 / lit.pixels - wander_dn**2
    u_scatter = lit.scatter_dn2 * np.sqrt(2 / (lit.frames - 1))
    u = float(np.linalg.norm(u_scatter / signal2)) / lit.frames.size
    return root_of(Estimate(float(np.mean(own / signal2)), u), 1.0)


def root_of(variance: Estimate, scale: float) -> Estimate:
    """Return the root of a variance, over a scale; a variance of about 0 has the u of its root."""
    if variance.value > 2 * variance.u:
        root = float(np.sqrt(variance.value))
        return Estimate(root / scale, variance.u / (2 * root) / scale)
    most = float(np.sqrt(max(variance.value, 0.0) + 2 * variance.u)) / scale
    return Estimate(most / 2, most / float(np.sqrt(12)))


def saturation_index(variance_dn2: FloatArray) -> int:
    """Return the index of the largest variance (exposures,) in DN², exposures in rising order.

    It is the saturation of EMVA 1288; of a camera that does not saturate it is the last exposure.
    """
    return int(np.argmax(variance_dn2))


def unsaturated(lit: LevelSeries, max_dn: float, dark_dn: float) -> BoolArray:
    """Return True for each exposure (exposures,), in rising order, without a cut-off pixel.

    max_dn: largest count in DN. dark_dn: level without light.
    """
    top = max_dn
    last, before = float(lit.mean_dn[-1]), float(lit.mean_dn[-2])
    if last - before < _LEVEL * (last - dark_dn):  # a full well below the converter's range
        top = min(top, last)
    limit = np.minimum(
        dark_dn + _BELOW_TOP * (top - dark_dn), top - _NOISE * np.sqrt(lit.variance_dn2)
    )
    return np.asarray(np.logical_and.accumulate(lit.mean_dn < limit))
