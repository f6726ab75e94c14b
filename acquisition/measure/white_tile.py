"""White tile as a standard: its radiance factor at the angles of its readings, and its errors.

The radiance factor comes from a table, or is one number. The number of a certificate holds at the
certificate's geometry. Away from it a tile departs from a perfect diffuser by several per cent,
which a number cannot tell: its uncertainty grows.

How much, is taken from the BRDF of sintered PTFE at 532 nm, the fit of T. A. Germer, Applied Optics
56 (2017) 9333, to his measurements: relative to its reflectance at 8 deg/hemispherical (0.984) the
radiance factor seen along the normal is 1.073 at theta_i 0, 1.044 at 30, 1.016 at 45, 0.975 at 60,
0.926 at 70 and 0.890 at 75 deg. Over all views up to 45 deg, and all dphi, its root mean square
departure is the one in `_DEPARTURE`, but at 45 deg, where it changes its sign (there 2.3 %).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from instrument.config.protocol import WhiteTile
from instrument.geometry import FloatArray, IntArray

# Relative departure from the 8 deg/hemispherical number, by the larger of theta_i and theta_r.
_LARGER_DEG = (0.0, 15.0, 30.0, 60.0, 70.0, 75.0, 80.0, 90.0)
_DEPARTURE = (0.074, 0.063, 0.040, 0.040, 0.071, 0.100, 0.137, 0.200)  # the last one: assumed
# Relative departure from the number of one direction, for each degree from it: the same data have
# 1.0 % in 5 and 2.9 % in 15 deg from 0/45, rms over the directions at that distance, and 0.3 %/deg
# at its steepest below 70 deg.
_PER_DEG = 0.003
_DIRECTIONS_DEG = {"0/45": (0.0, 45.0), "45/0": (45.0, 0.0)}  # theta_i, theta_r
_SHARED_BY_ALL = 0.5  # of the variance of the departure; the rest is of each geometry (assumed)

Error = tuple[FloatArray, IntArray]


@dataclass(frozen=True, slots=True, kw_only=True)
class Standard:
    """Radiance factor of the tile for N points, (N,), each at the angles of its own tile reading.

    errors: each a relative standard uncertainty (N,) and a group (N,); points with the same number
    in `group` share the error. departure: (N,), relative u for being away from the certificate's
    geometry, which is part of the errors.
    """

    beta: FloatArray
    errors: tuple[Error, ...]
    departure: FloatArray


def standard(tile: WhiteTile, theta_i_deg: FloatArray, dphi_deg: FloatArray) -> Standard:
    """Return the tile's radiance factor with the lamp at theta_i (N,) and dphi (N,), in degrees.

    Raises `OutsideTable`.
    """
    lamps = np.stack([theta_i_deg, dphi_deg], axis=-1).reshape(-1, 2)
    settings, own = np.unique(lamps, axis=0, return_inverse=True)
    found = _of_table(tile, settings) if tile.values is not None else _of_number(tile, settings)
    own = own.reshape(-1)
    return Standard(
        beta=found.beta[own],
        errors=tuple((u[own], group[own]) for u, group in found.errors),
        departure=found.departure[own],
    )


def _of_table(tile: WhiteTile, settings: FloatArray) -> Standard:
    """Return the table's values at settings (M, 2) of the lamp: theta_i and dphi in degrees.

    The u of a value in the table is shared by all that is interpolated from it.
    """
    assert tile.values is not None
    values = [tile.values.at(float(i), tile.theta_r_deg, float(dphi)) for i, dphi in settings]
    beta = np.array([value.beta for value in values])
    corners = np.array([value.corners for value in values], dtype=np.int64)
    u_corners = np.array([value.u_corners for value in values])
    cells = np.array([value.cell for value in values], dtype=np.int64)
    all_alike = np.zeros(len(values), dtype=np.int64)
    found: list[Error] = [(np.array([v.u_common for v in values]), all_alike)]
    found += zip(u_corners.T, corners.T, strict=True)
    found.append((np.array([v.u_between for v in values]), cells))
    kept = [(u / beta, group) for k, (u, group) in enumerate(found) if k == 0 or u.any()]
    return Standard(beta=beta, errors=tuple(kept), departure=np.zeros(beta.size))


def _of_number(tile: WhiteTile, settings: FloatArray) -> Standard:
    """Return the one number at settings (M, 2) of the lamp: theta_i and dphi in degrees."""
    count = len(settings)
    beta = np.full(count, tile.reflectance)
    all_alike, each = np.zeros(count, dtype=np.int64), np.arange(count, dtype=np.int64)
    certified = np.full(count, tile.u_reflectance) / beta
    departure = np.array([_departure(tile, float(theta_i)) for theta_i in settings[:, 0]])
    errors: list[Error] = [(certified, all_alike)]
    if departure.any():
        errors.append((math.sqrt(_SHARED_BY_ALL) * departure, all_alike))
        errors.append((math.sqrt(1 - _SHARED_BY_ALL) * departure, each))
    return Standard(beta=beta, errors=tuple(errors), departure=departure)


def _departure(tile: WhiteTile, theta_i_deg: float) -> float:
    """Return the relative u of the number away from its geometry; 0 if it holds everywhere."""
    if tile.certificate in (None, "lambertian"):
        return 0.0
    theta_r_deg = abs(tile.theta_r_deg)
    by_angle = float(np.interp(max(theta_i_deg, theta_r_deg), _LARGER_DEG, _DEPARTURE))
    return min([by_angle, *_by_distance(tile, theta_i_deg, theta_r_deg)])


def _by_distance(tile: WhiteTile, theta_i_deg: float, theta_r_deg: float) -> Iterator[float]:
    if tile.certificate in _DIRECTIONS_DEG:
        theta_i, theta_r = _DIRECTIONS_DEG[tile.certificate]
        yield _PER_DEG * max(abs(theta_i_deg - theta_i), abs(theta_r_deg - theta_r))
