"""Collision check of one axis's move with a keep-out zone, exact over the whole path."""

from __future__ import annotations

import math
from collections.abc import Iterator

from acquisition.plan.pose import Pose
from instrument.config.axes import AXES
from instrument.config.rig import KeepOut


def enters_zone(zone: KeepOut, start: Pose, end: Pose, axis: str) -> bool:
    """Return True if moving `axis` from `start` to `end`, all else equal, touches the zone.

    A pose with an unknown angle (nan: hand-set axis, not set yet) touches no zone.
    """
    if zone.camera_to_lamp_deg is not None:
        return _min_separation_deg(start, end, axis) < zone.camera_to_lamp_deg
    return all(_overlaps(zone, start, end, name) for name in AXES)


def _overlaps(zone: KeepOut, start: Pose, end: Pose, name: str) -> bool:
    limits = getattr(zone, f"{name}_deg")
    if limits is None:
        return True
    low, high = sorted((getattr(start, name), getattr(end, name)))
    return bool(low <= limits[1] and high >= limits[0])


def _min_separation_deg(start: Pose, end: Pose, axis: str) -> float:
    """Return the smallest angle between camera and lamp along the move."""
    low, high = sorted((getattr(start, axis), getattr(end, axis)))
    inner = [angle for angle in _stationary_deg(start, axis) if low < angle < high]
    return min(start._replace(**{axis: angle}).separation_deg for angle in (low, high, *inner))


def _stationary_deg(pose: Pose, axis: str) -> Iterator[float]:
    """Yield the angles of `axis` at which the separation is stationary, over two turns.

    cos(separation) = cos(theta_i) cos(theta_r) + sin(theta_i) sin(theta_r) cos(dphi): stationary
    in dphi at multiples of 180; in theta_r where tan(theta_r) = tan(theta_i) cos(dphi).
    """
    if axis == "dphi":
        first = 0.0
    else:
        other_rad = math.radians(pose.theta_r if axis == "theta_i" else pose.theta_i)
        cosine = math.cos(math.radians(pose.dphi))
        first = math.degrees(math.atan2(math.sin(other_rad) * cosine, math.cos(other_rad)))
    yield from (first + 180.0 * turn for turn in range(-4, 5))
