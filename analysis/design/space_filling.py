"""Geometries spread over a list: where a model that is wrong anywhere would show it."""

from __future__ import annotations

import numpy as np

from instrument.geometry import BoolArray, FloatArray, Geometry, camera_direction, lamp_direction

_SAME = 1e-9  # distances closer than this, squared, are equal


def farthest(geometry: Geometry, count: int) -> BoolArray:
    """Mark `count` of N geometries (N,), each the farthest from those before it.

    The first is the one nearest to the middle of the list. The distance of two is that of their
    lamps' and of their cameras' directions together. Of equal ones the first in the list counts.
    """
    places = _places(geometry)
    chosen = np.zeros(len(places), dtype=bool)
    if count == 0:
        return chosen
    nearest = np.full(len(places), np.inf)
    point = int(np.argmin(np.round(_squared(places, places.mean(axis=0)) / _SAME)))
    for _ in range(count):
        chosen[point] = True
        nearest = np.minimum(nearest, _squared(places, places[point]))
        point = int(np.argmax(np.where(chosen, -1.0, np.round(nearest / _SAME))))
    return chosen


def farthest_from(geometry: Geometry, chosen: BoolArray, allowed: BoolArray) -> int | None:
    """Return the geometry, of those allowed (N,), that is the farthest from those chosen (N,).

    The masks have no unit. None where all that are allowed are chosen; where none is chosen yet,
    the one nearest to the middle of the list.
    """
    places, free = _places(geometry), allowed & ~chosen
    if not free.any():
        return None
    if chosen.any():
        apart = np.min([_squared(places, places[k]) for k in np.flatnonzero(chosen)], axis=0)
    else:
        apart = -_squared(places, places.mean(axis=0))
    return int(np.argmax(np.where(free, np.round(apart / _SAME), -np.inf)))


def nearest_to(
    one: Geometry, geometry: Geometry, chosen: BoolArray, allowed: BoolArray
) -> int | None:
    """Return the geometry, of those allowed (N,) and not chosen (N,), nearest to a single one.

    The masks have no unit. None where all that are allowed are chosen.
    """
    free = allowed & ~chosen
    apart = np.round(_squared(_places(geometry), _places(one)[0]) / _SAME)
    return int(np.argmin(np.where(free, apart, np.inf))) if free.any() else None


def _places(geometry: Geometry) -> FloatArray:
    """Unit vectors to lamp and camera, (N, 6), with the lamp in one plane for all."""
    camera = lamp_direction(geometry.theta_r_deg, geometry.dphi_deg)  # polar angle and azimuth
    return np.hstack([camera_direction(geometry.theta_i_deg), camera])


def _squared(places: FloatArray, to: FloatArray) -> FloatArray:
    return np.asarray(np.square(places - to).sum(axis=1))
