"""Angles in radians where degrees are expected: recognised by whole degrees after conversion.

Rounded angles stay round in their own unit alone: 0.5236 is no plausible angle of a plan in
degrees, and 30 degrees in radians.
"""

from __future__ import annotations

import math

import numpy as np

from analysis.data.measurements import Measurements
from instrument.geometry import FloatArray

_RIGHT_ANGLE, _ROUNDING = math.pi / 2, 2e-3  # radians
# Steps of angles that count as round, and how near, in degrees: three decimals in radians are
# 0.03 degrees. Chance hits one of eight angles, so four of four by 1 in 4 000.
_ROUND_DEG, _NEAR_DEG = 0.5, 0.03
_ROUND_AS_GIVEN, _EXACT = 0.05, 1e-6
_FEWEST, _MOST_STRAYS = 4, 0.05


def angle_unit_text(m: Measurements) -> str:
    """Return that angles seem to be in radians, with the evidence; "" if they do not."""
    tilts = _distinct(np.concatenate([m.theta_i_deg, m.theta_r_deg]))
    if np.all(tilts <= _RIGHT_ANGLE + _ROUNDING) and _whole_degrees(tilts):
        return (
            f"angles in radians? theta_i_deg and theta_r_deg are all below 1.58, and their "
            f"{tilts.size} values are whole or half degrees once converted (largest: "
            f"{tilts.max():.5g}, as radians {np.degrees(tilts.max()):.4g} degrees); angles are "
            "read in degrees: convert them"
        )
    turns = _distinct(m.dphi_deg)
    quarters = turns / _RIGHT_ANGLE
    near = np.abs(quarters - np.round(quarters)) * _RIGHT_ANGLE < _ROUNDING
    if turns.size and np.all(turns <= 4 * _RIGHT_ANGLE + _ROUNDING) and np.any(near):
        return (
            f"dphi in radians? dphi_deg is at most {turns.max():.5g}, and {turns[near][-1]:.5g} is "
            f"{np.degrees(turns[near][-1]):.4g} degrees if it is in radians; angles are read in "
            "degrees: convert them"
        )
    return ""


def _distinct(angles: FloatArray) -> FloatArray:
    """Sizes of the angles, each once, without 0."""
    sizes = np.unique(np.abs(angles))
    return sizes[sizes > 0]


def _whole_degrees(angles: FloatArray) -> bool:
    """True if the angles are round in degrees once converted from radians, and not as given."""
    if angles.size < _FEWEST:
        return False
    strays = np.mean(_off(np.degrees(angles), _ROUND_DEG) > _NEAR_DEG)
    return bool(strays <= _MOST_STRAYS and np.mean(_off(angles, _ROUND_AS_GIVEN) < _EXACT) < 0.5)


def _off(values: FloatArray, step: float) -> FloatArray:
    """Distance of each value from the next multiple of the step."""
    return np.abs(values - step * np.round(values / step))
