"""From one pose of the rig to the next: which axis moves when, and how long it takes.

One axis moves at a time, so that the path is known and can be checked whole against the keep-out
zones. Every angle is approached from below (the play of the gears is then always on one side).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations
from typing import NamedTuple

from acquisition.plan.keep_out import obstacle
from instrument.config.axes import AXES, HandAxis
from instrument.config.rig import Rig
from instrument.errors import InputError
from instrument.kinematics import Trapezoid

SAME_DEG = 1e-9  # two angles closer than this are one: far below what any stage resolves


class Pose(NamedTuple):
    """Where the axes stand, in the rig's degrees (theta_r signed); nan where nobody knows yet."""

    theta_i: float
    dphi: float
    theta_r: float

    def __str__(self) -> str:
        return f"theta_i {self.theta_i:g}, dphi {self.dphi:g}, theta_r {self.theta_r:g} deg"


@dataclass(frozen=True, slots=True)
class Move:
    """One axis to one angle (rig's degrees), with the time that takes, settling included."""

    axis: str
    angle_deg: float
    duration_s: float


class NoPathError(InputError):
    """No order of the axes leads from one pose to another; `cause` is what stands in the way."""

    def __init__(self, way: str, cause: str, move: str) -> None:
        super().__init__(f"{way}: {move}")
        self.cause, self.move = cause, move


def home_pose(rig: Rig) -> Pose:
    """Where the axes stand after homing; a hand-set axis stands nobody knows where."""
    return Pose(
        *(
            float("nan") if isinstance(axis, HandAxis) else axis.home_deg
            for axis in (rig.axes[name] for name in AXES)
        )
    )


def moves_between(start: Pose, end: Pose, rig: Rig) -> tuple[Move, ...]:
    """The moves from `start` to `end` clear of all keep-out zones, hand-set axes first if they can.

    Raises `NoPathError` with what is in the way when every order of the axes meets something.
    """
    changed = [n for n in AXES if not abs(getattr(end, n) - getattr(start, n)) <= SAME_DEG]
    changed.sort(key=lambda name: not isinstance(rig.axes[name], HandAxis))
    found: tuple[str, str] | None = None
    for order in permutations(changed):
        moves = tuple(_moves(start, end, order, rig))
        obstacle_here = _obstacle_on(start, moves, rig)
        if obstacle_here is None:
            return moves
        found = found or obstacle_here
    raise NoPathError(f"from {start} to {end}", *(found or ("", "")))


def _moves(start: Pose, end: Pose, order: tuple[str, ...], rig: Rig) -> Iterator[Move]:
    for name in order:
        yield from axis_moves(name, getattr(start, name), getattr(end, name), rig)


def axis_moves(name: str, start_deg: float, end_deg: float, rig: Rig) -> Iterator[Move]:
    """The moves of one axis: straight when upwards, past the angle and back when downwards."""
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


def _obstacle_on(start: Pose, moves: tuple[Move, ...], rig: Rig) -> tuple[str, str] | None:
    """What the moves would meet: the cause and the move in words; None when all is clear."""
    pose = start
    for move in moves:
        axis = rig.axes[move.axis]
        if not axis.min_deg - SAME_DEG <= move.angle_deg <= axis.max_deg + SAME_DEG:
            return (
                f"limits of {move.axis}",
                f"{move.axis} would go to {move.angle_deg:g} deg to take up the backlash; its "
                f"limits are {axis.min_deg:g} to {axis.max_deg:g} deg: stay further inside them",
            )
        first = getattr(pose, move.axis)
        if math.isnan(first):  # nobody knows where a hand takes it from: only the end is checked
            first = move.angle_deg
        target = pose._replace(**{move.axis: move.angle_deg})
        begin = pose._replace(**{move.axis: first})
        for zone in rig.keep_out:
            if obstacle(zone, begin, target, move.axis):
                return (
                    f"keep-out zone {zone.name}",
                    f"the move of {move.axis} from {first:g} to {move.angle_deg:g} deg meets the "
                    f"keep-out zone '{zone.name}': leave these angles out, or split the sweep",
                )
        pose = target
    return None
