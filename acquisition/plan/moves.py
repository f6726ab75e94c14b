"""Moves from one pose of the rig to the next: order of the axes, backlash, durations.

One axis moves at a time, so that the path is known and can be checked against the keep-out zones.
Every angle is approached from below, so that backlash always has the same sign.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, permutations

from acquisition.plan.keep_out import enters_zone
from acquisition.plan.pose import Pose
from instrument.config.axes import AXES, HandAxis
from instrument.config.rig import Rig
from instrument.errors import InputError
from instrument.kinematics import Trapezoid

SAME_ANGLE_DEG = 1e-9  # angles closer than this are equal: far below any stage's resolution


@dataclass(frozen=True, slots=True)
class Move:
    """Move of one axis to an angle in the rig's degrees; its duration includes settling."""

    axis: str
    angle_deg: float
    duration_s: float


class NoPathError(InputError):
    """No order of the axes leads from one pose to another; `cause` names the obstacle."""

    def __init__(self, path: str, cause: str, move: str) -> None:
        super().__init__(f"{path}: {move}")
        self.cause, self.move = cause, move


def moves_between(start: Pose, end: Pose, rig: Rig) -> tuple[Move, ...]:
    """Return moves from `start` to `end` clear of all keep-out zones, hand-set axes first if clear.

    Raises `NoPathError` with the first obstacle if no order of the axes is clear.
    """
    changed = [n for n in AXES if not abs(getattr(end, n) - getattr(start, n)) <= SAME_ANGLE_DEG]
    changed.sort(key=lambda name: not isinstance(rig.axes[name], HandAxis))
    first_obstacle: tuple[str, str] | None = None
    for order in permutations(changed):
        legs = (axis_moves(name, getattr(start, name), getattr(end, name), rig) for name in order)
        moves = tuple(chain.from_iterable(legs))
        obstacle = _obstacle(start, moves, rig)
        if obstacle is None:
            return moves
        first_obstacle = first_obstacle or obstacle
    raise NoPathError(f"from {start} to {end}", *(first_obstacle or ("", "")))


def axis_moves(name: str, start_deg: float, end_deg: float, rig: Rig) -> Iterator[Move]:
    """Yield the moves of one axis: direct if upwards, past the angle and back if downwards."""
    axis = rig.axes[name]
    if isinstance(axis, HandAxis):
        yield Move(name, end_deg, axis.set_s)
        return
    stops = [end_deg]
    if end_deg < start_deg and axis.backlash_deg > 0:
        stops.insert(0, end_deg - axis.backlash_deg)
    for stop_deg in stops:
        move = Trapezoid(stop_deg - start_deg, axis.speed_deg_per_s, axis.acceleration_deg_per_s2)
        settle_s = axis.settle_s if stop_deg == end_deg else 0.0
        yield Move(name, stop_deg, move.duration_s + settle_s)
        start_deg = stop_deg


def first_obstacle(start: Pose, end: Pose, axis: str, rig: Rig) -> tuple[str, str] | None:
    """Return the first obstacle to a turn of one motor, as its cause and in words, or None.

    Both ends must lie within its limits, and its way clear of all keep-out zones.
    """
    limits = rig.axes[axis]
    for angle_deg in (getattr(start, axis), getattr(end, axis)):
        if not limits.min_deg - SAME_ANGLE_DEG <= angle_deg <= limits.max_deg + SAME_ANGLE_DEG:
            return (
                f"limits of {axis}",
                f"{axis} would go to {angle_deg:g} deg to reach a steady speed; its limits are "
                f"{limits.min_deg:g} to {limits.max_deg:g} deg: stay further inside them",
            )
    for zone in rig.keep_out:
        if enters_zone(zone, start, end, axis):
            return (
                f"keep-out zone {zone.name}",
                f"the turn of {axis} from {getattr(start, axis):g} to {getattr(end, axis):g} deg "
                f"meets the keep-out zone '{zone.name}': leave these angles out, or split the "
                "sweep",
            )
    return None


def _obstacle(start: Pose, moves: tuple[Move, ...], rig: Rig) -> tuple[str, str] | None:
    """Return the first obstacle on the path, as its cause and the move in words, or None."""
    pose = start
    for move in moves:
        axis = rig.axes[move.axis]
        if not axis.min_deg - SAME_ANGLE_DEG <= move.angle_deg <= axis.max_deg + SAME_ANGLE_DEG:
            return (
                f"limits of {move.axis}",
                f"{move.axis} would go to {move.angle_deg:g} deg to take up the backlash; its "
                f"limits are {axis.min_deg:g} to {axis.max_deg:g} deg: stay further inside them",
            )
        first = getattr(pose, move.axis)
        if math.isnan(first):  # the hand-set axis may come from anywhere: only the end is checked
            first = move.angle_deg
        target = pose._replace(**{move.axis: move.angle_deg})
        begin = pose._replace(**{move.axis: first})
        for zone in rig.keep_out:
            if enters_zone(zone, begin, target, move.axis):
                return (
                    f"keep-out zone {zone.name}",
                    f"the move of {move.axis} from {first:g} to {move.angle_deg:g} deg meets the "
                    f"keep-out zone '{zone.name}': leave these angles out, or split the sweep",
                )
        pose = target
    return None
