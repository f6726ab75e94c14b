"""Helpers for the models' validity kernels, and the range check of polar angles."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from analysis.models.base import Validity
from instrument.geometry import BoolArray, FloatArray, Geometry

GRAZING = "lamp and camera both graze the surface, where the formula grows without limit"
NEGATIVE = "negative as printed, far forward at high roughness"


def both_graze(geometry: Geometry) -> BoolArray:
    """Mask of the geometry's shape: lamp and camera both at 90 degrees (no limit of 1/cos)."""
    return np.asarray(np.minimum(geometry.theta_i_deg, geometry.theta_r_deg) >= 90.0)


def either_grazes(geometry: Geometry) -> BoolArray:
    """Mask of the geometry's shape: lamp or camera at 90 degrees."""
    return np.asarray(np.maximum(geometry.theta_i_deg, geometry.theta_r_deg) >= 90.0)


def valid_except(geometry: Geometry, *failures: tuple[BoolArray | bool, str]) -> Validity:
    """Validity from pairs (mask of failures, reason), masks of the geometry's shape or scalar.

    The reason lists those that occur.
    """
    mask = np.ones(geometry.shape, dtype=bool)
    reasons = []
    for fails, reason in failures:
        if np.any(fails):
            mask &= ~np.asarray(fails)
            reasons.append(reason)
    return Validity(mask, "; ".join(reasons))


def valid_unless_both_graze(geometry: Geometry, **_: float) -> Validity:
    """Validity of a formula that diverges at grazing only. Arguments as in `Model.brdf`."""
    return valid_except(geometry, (both_graze(geometry), GRAZING))


def polar(name: str, angle: ArrayLike) -> FloatArray:
    """Polar angle in radians, any shape, as floats. Raises `ValueError` outside 0 to pi/2."""
    angle = np.asarray(angle, dtype=np.float64)
    allowed = (angle >= 0) & (angle <= np.pi / 2)
    if not np.all(allowed):
        raise ValueError(f"{name} = {angle[~allowed].flat[0]:.12g} radians; allowed: 0 to pi/2")
    return angle
