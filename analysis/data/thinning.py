"""A part of many measurements that shows every minimum of chi2 that all of them show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from analysis.data.measurements import Measurements
from analysis.data.sweeps import plane_and_view
from instrument.geometry import BoolArray, FloatArray

# Share of the points that may be peaks; a peak is above the median around it by this factor.
_SHARE_OF_PEAKS, _PEAK = 0.5, 1.2


def thinned(m: Measurements, most: int) -> Measurements:
    """Return at most `most` of the measurements, or all: evenly spread, and the peaks among them.

    They are spread along the sweeps, in the order of incidence, plane and view angle. A narrow lobe
    may fall between them, so the highest value of each stretch is among them where it stands out:
    with a larger u, as it stands for itself alone and each of the others for several.
    """
    if m.size <= most:
        return m
    plane, view = plane_and_view(m)
    order = np.lexsort((view, plane, m.theta_i_deg))
    peaks = _peaks(m.brdf[order], round(_SHARE_OF_PEAKS * most))
    others = np.flatnonzero(~peaks)
    even = np.linspace(0, others.size - 1, most - int(peaks.sum())).round().astype(np.int64)
    chosen = np.zeros(m.size, dtype=bool)
    chosen[order[peaks]] = chosen[order[others[even]]] = True
    if m.u_random is not None:
        u = m.u_random.copy()
        u[order[peaks]] *= np.sqrt(others.size / even.size)
        m = replace(m, u_random=u)
    return m.subset(chosen)


def _peaks(values: FloatArray, stretches: int) -> BoolArray:
    """Mark the highest of the values (N,) of each stretch, where it stands out."""
    found = np.zeros(values.size, dtype=bool)
    for part in np.array_split(np.arange(values.size), stretches):
        highest = part[np.argmax(values[part])]
        found[highest] = values[highest] > _PEAK * np.median(values[part])
    return found
