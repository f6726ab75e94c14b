"""Linearity error of EMVA 1288, release 4.0 Linear."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from analysis.calibration.level_series import LevelSeries
from instrument.geometry import FloatArray

_LOW, _HIGH = 0.05, 0.95  # of the saturation: the range of the fit


class LinearityError(NamedTuple):
    """Smallest and largest deviation of the signal from the standard's line, in %."""

    least_percent: float
    most_percent: float


def linearity_error(lit: LevelSeries, dark_mean_dn: FloatArray, saturated: int) -> LinearityError:
    """Return LE of levels in the order of rising exposure, of a constant light.

    dark_mean_dn: dark level at each of these exposures (exposures,) in DN. saturated: index of the
    level of saturation. The line minimises the relative deviations.
    """
    signal = lit.mean_dn - dark_mean_dn
    top = signal[saturated]
    inside = (signal >= _LOW * top) & (signal <= _HIGH * top)
    light, counts = lit.exposure_s[inside], signal[inside]
    offset, slope = np.polynomial.polynomial.polyfit(light, counts, 1, w=1 / counts)
    deviation = 100 * (counts / (offset + slope * light) - 1)
    return LinearityError(float(deviation.min()), float(deviation.max()))
