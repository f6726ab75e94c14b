"""Uncertainty by scatter (Type A, GUM 4.2), beside the one that noise predicts (Type B).

Frames of one reading, and drift checks of one geometry, scatter at least by their noise. Where they
surely scatter more, the larger value counts: `acquisition.interlocks.frame_scatter` for frames, and
`acquisition.measure.drift` for checks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from acquisition.measure.radiometry import photon_transfer
from instrument.config.camera import CameraConfig
from instrument.geometry import FloatArray
from instrument.record.reading import Reading

# A larger scatter is seen in one of 30 000 sound readings, and in one of 1000 series of checks.
SEEN_SIGMA, _SEEN_IN_CHECKS_SIGMA = 4.0, 3.0


def chi_squared_limit(freedom: float, sigma: float) -> float:
    """Return the value that chi-squared exceeds as seldom as a normal deviate `sigma`.

    Wilson and Hilferty 1931: the cube root of chi-squared is nearly normal; at one degree of
    freedom the limit is a fifth too large.
    """
    if not freedom:
        return 0.0
    part = 2 / (9 * freedom)
    return float(freedom * (1 - part + sigma * math.sqrt(part)) ** 3)


def noise_ratio(readings: Sequence[Reading], camera: CameraConfig) -> float:
    """Return the median ratio of the noise of readings to that of photons and read-out; 1 for none.

    The predicted one is that of the rig file's photon transfer, for equal weights of all pixels.
    """
    ratios = [
        reading.u_noise_dn / _predicted_dn(reading, camera)
        for reading in readings
        if reading.window_pixels > 0 and reading.frames > 1
    ]
    return float(np.median(ratios)) if ratios else 1.0


def _predicted_dn(reading: Reading, camera: CameraConfig) -> float:
    level_dn = camera.black_level_dn + max(reading.signal_dn, 0.0)
    variance = float(photon_transfer(np.asarray(level_dn), camera)) + 1 / 12  # of rounding
    return math.sqrt(variance / (reading.frames * reading.window_pixels))


def scatter_ratio(times_s: FloatArray, level: FloatArray, u: FloatArray) -> float:
    """Return the scatter of levels (N,) in units of their noise u (N,); 1 if it may be noise alone.

    Of each level from the straight line between its neighbours in time (N,): a steady drift does
    not count. Neighbouring ones share levels, so that they count as half as many.
    """
    if level.size < 4 or np.any(np.diff(times_s) <= 0):
        return 1.0
    share = (times_s[1:-1] - times_s[:-2]) / (times_s[2:] - times_s[:-2])
    off = level[1:-1] - (1 - share) * level[:-2] - share * level[2:]
    variance = u[1:-1] ** 2 + ((1 - share) * u[:-2]) ** 2 + (share * u[2:]) ** 2
    mean, freedom = float(np.mean(off**2 / variance)), off.size / 2
    seen = mean * freedom > chi_squared_limit(freedom, _SEEN_IN_CHECKS_SIGMA)
    return math.sqrt(mean) if seen else 1.0
