"""Does a move of one axis meet a keep-out zone anywhere on its way? Worked out, not sampled."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Protocol

from instrument.config.axes import AXES
from instrument.config.rig import KeepOut
from instrument.geometry import camera_to_lamp_deg


class Angles(Protocol):
    """Anything with the three angles of a pose, in degrees."""

    @property
    def theta_i(self) -> float: ...  # noqa: D102 - the pose's own name
    @property
    def dphi(self) -> float: ...  # noqa: D102 - the pose's own name
    @property
    def theta_r(self) -> float: ...  # noqa: D102 - the pose's own name


def obstacle(zone: KeepOut, start: Angles, end: Angles, axis: str) -> bool:
    """Whether moving `axis` from `start` to `end` (all else equal) touches the zone.

    An axis of unknown angle (nan: set by hand, not set yet) touches nothing.
    """
    if zone.camera_to_lamp_deg is not None:
        return _closest_deg(start, end, axis) < zone.camera_to_lamp_deg
    return all(_overlaps(zone, start, end, name) for name in AXES)


def _overlaps(zone: KeepOut, start: Angles, end: Angles, name: str) -> bool:
    limits = getattr(zone, f"{name}_deg")
    if limits is None:
        return True
    low, high = sorted((getattr(start, name), getattr(end, name)))
    return bool(low <= limits[1] and high >= limits[0])


def _closest_deg(start: Angles, end: Angles, axis: str) -> float:
    """The least angle between camera and lamp on the way."""
    fixed = {name: getattr(start, name) for name in AXES}
    low, high = sorted((getattr(start, axis), getattr(end, axis)))
    nearest = [angle for angle in _stationary_deg(fixed, axis) if low < angle < high]
    return min(_separation_deg(fixed | {axis: angle}) for angle in (low, high, *nearest))


def _separation_deg(angles: dict[str, float]) -> float:
    return float(camera_to_lamp_deg(angles["theta_i"], angles["theta_r"], angles["dphi"]))


def _stationary_deg(fixed: dict[str, float], axis: str) -> Iterator[float]:
    """Angles of `axis` at which the separation is stationary, over two turns.

    cos(separation) = cos(theta_i) cos(theta_r) + sin(theta_i) sin(theta_r) cos(dphi): stationary
    in dphi at multiples of 180; in theta_r where tan(theta_r) = tan(theta_i) cos(dphi).
    """
    if axis == "dphi":
        first = 0.0
    else:
        other = fixed["theta_r" if axis == "theta_i" else "theta_i"]
        cosine = math.cos(math.radians(fixed["dphi"]))
        other_rad = math.radians(other)
        first = math.degrees(math.atan2(math.sin(other_rad) * cosine, math.cos(other_rad)))
    yield from (first + 180.0 * turn for turn in range(-4, 5))
