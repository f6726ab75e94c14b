"""Where the formulas end: what the models' `holds` kernels share, and the angles of the others."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from analysis.models.base import Validity
from instrument.geometry import BoolArray, FloatArray, Geometry

GRAZING = "lamp and camera both graze the surface, where the formula grows without limit"
NEGATIVE = "negative as printed, far forward at high roughness"


def both_graze(geometry: Geometry) -> BoolArray:
    """Where lamp and camera both lie in the sample's plane: 1/cos and tan(beta) have no limit."""
    return np.asarray(np.minimum(geometry.theta_i_deg, geometry.theta_r_deg) >= 90.0)


def either_grazes(geometry: Geometry) -> BoolArray:
    """Where lamp or camera lies in the sample's plane."""
    return np.asarray(np.maximum(geometry.theta_i_deg, geometry.theta_r_deg) >= 90.0)


def held(geometry: Geometry, *failures: tuple[BoolArray | bool, str]) -> Validity:
    """Validity from pairs (where it fails, why): the reasons are those that occur."""
    mask = np.ones(geometry.shape, dtype=bool)
    reasons = []
    for where, why in failures:
        if np.any(where):
            mask &= ~np.asarray(where)
            reasons.append(why)
    return Validity(mask, "; ".join(reasons))


def polar(name: str, angle: ArrayLike) -> FloatArray:
    """The angle from a normal, in radians. Raises `ValueError` for one outside 0 to pi/2."""
    angle = np.asarray(angle, dtype=np.float64)
    fine = (angle >= 0) & (angle <= np.pi / 2)
    if not np.all(fine):
        raise ValueError(f"{name} = {angle[~fine].flat[0]:.12g} radians; allowed: 0 to pi/2")
    return angle
