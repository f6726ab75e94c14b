"""Where the models' formulas end: what their `holds` kernels share."""

from __future__ import annotations

import numpy as np

from analysis.models.base import BoolArray, Validity
from instrument.geometry import Geometry


def both_graze(geometry: Geometry) -> BoolArray:
    """Where lamp and camera both lie in the sample's plane: 1/cos and tan(beta) have no limit."""
    return np.asarray(np.minimum(geometry.theta_i_deg, geometry.theta_r_deg) >= 90.0)


def held(geometry: Geometry, *failures: tuple[BoolArray | bool, str]) -> Validity:
    """Validity from pairs (where it fails, why): the reasons are those that occur."""
    mask = np.ones(geometry.shape, dtype=bool)
    reasons = []
    for where, why in failures:
        if np.any(where):
            mask &= ~np.asarray(where)
            reasons.append(why)
    return Validity(mask, "; ".join(reasons))
