"""Sweeps of a scan: the points of one incidence in one plane, ordered by view angle."""

from __future__ import annotations

from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from analysis.data.measurements import Measurements
from instrument.geometry import FloatArray, Geometry, IntArray

_DECIMALS = 3  # degrees equal to this many decimals are one setting


class Sweep(NamedTuple):
    """theta_i and dphi (0 to below 180) in degrees, and the points' indices by rising theta_r."""

    theta_i_deg: float
    dphi_deg: float
    points: IntArray


# Every candidate's residuals are looked at along the same sweeps.
_found: WeakKeyDictionary[Geometry, tuple[Sweep, ...]] = WeakKeyDictionary()


def sweeps(m: Measurements) -> tuple[Sweep, ...]:
    """All sweeps of at least two points, by incidence and plane."""
    if m.geometry not in _found:
        _found[m.geometry] = tuple(_sweeps(m))
    return _found[m.geometry]


def _sweeps(m: Measurements) -> list[Sweep]:
    plane, views = plane_and_view(m)
    settings = np.stack([np.round(m.theta_i_deg, _DECIMALS), plane], axis=1)
    values, member = np.unique(settings, axis=0, return_inverse=True)
    member = member.reshape(-1)
    order = np.lexsort((views, member))
    groups = np.split(order, np.cumsum(np.bincount(member))[:-1])
    return [
        Sweep(theta_i, dphi, points)
        for (theta_i, dphi), points in zip(values.tolist(), groups, strict=True)
        if points.size > 1
    ]


def plane_and_view(m: Measurements) -> tuple[FloatArray, FloatArray]:
    """dphi (N,), folded to 0 to below 180 degrees, and theta_r (N,) signed in that plane."""
    azimuth = np.mod(np.round(m.dphi_deg, _DECIMALS), 360.0)
    over = azimuth >= 180.0
    return np.where(over, azimuth - 180.0, azimuth), np.where(over, -m.theta_r_deg, m.theta_r_deg)


def signed_view(m: Measurements) -> FloatArray:
    """theta_r (N,) in degrees, positive on the side of its plane where dphi is below 180."""
    return plane_and_view(m)[1]
