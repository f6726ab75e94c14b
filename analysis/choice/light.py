"""Presence of light in a table: values that are more than noise about zero."""

from __future__ import annotations

import math

import numpy as np

from analysis.data.measurements import Measurements
from instrument.errors import NotDetermined

_LEAST_MEAN = 1e-15  # of the values, in their unit: no instrument measures less
_SIGNIFICANT = 3.0  # standard deviations of the mean


def require_light(m: Measurements) -> None:
    """Raise `NotDetermined` where the mean is zero within three standard deviations of it.

    Noise about zero is symmetric, so the negative values alone give its standard deviation; the
    reflection of a sample has none. A stated u is not used: it may be far from the scatter.
    """
    if m.size == 0:
        raise NotDetermined("no point to fit")
    mean = float(np.mean(m.brdf))
    negative = m.brdf[m.brdf < 0]
    noise = math.sqrt(float(np.mean(np.square(negative)))) if negative.size else 0.0
    least = max(_LEAST_MEAN, _SIGNIFICANT * noise / math.sqrt(m.size))
    if not mean > least:
        raise NotDetermined(
            f"no light in this table: mean value {mean:.3g}, standard deviation of the noise about "
            f"zero {noise:.3g}; allowed: a mean above {least:.3g}. Check lamp, shutter and sample"
        )
