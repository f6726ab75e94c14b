"""Tour of an adaptive scan's points: in which order to measure them, so that the rig moves little.

One setting of the lamp after the other, and the views of each rising or falling: the lamp's way and
the crossing of the views take most of the time that an order can save.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise, permutations, product

from acquisition.plan.plan import Step
from acquisition.plan.pose import Pose

_COMPARED = 4
"""Settings of the lamp up to which all orders are compared: of more, the nearest comes next."""

MovesS = Callable[[Pose, Pose], float]
"""Time in s of the moves from one pose to another; infinite where no way leads there."""


def tour(start: Pose, points: Iterable[Step], moves_s: MovesS) -> list[Step]:
    """Return the points in an order that is quick to measure from a pose.

    Points to which no way leads from the one before are left out.
    """
    settings: dict[int, list[Step]] = {}
    for point in sorted(points, key=lambda step: (step.pose.theta_r, step.index)):
        settings.setdefault(point.lamp_setting, []).append(point)
    views = list(settings.values())
    if len(views) <= _COMPARED:
        quickest = _quickest(start, views, moves_s)
        if quickest is not None:
            return quickest
    return _nearest_next(start, views, moves_s)


def _quickest(start: Pose, views: Sequence[list[Step]], moves_s: MovesS) -> list[Step] | None:
    """Return the quickest order of all; None where no order has a way to every point."""
    both = [(own, own[::-1]) for own in views]
    within_s = [[_within_s(order, moves_s) for order in pair] for pair in both]
    runs = [(k, way) for k in range(len(views)) for way in (0, 1)]
    first_s = {run: moves_s(start, both[run[0]][run[1]][0].pose) for run in runs}
    next_s = {
        (a, b): moves_s(both[a[0]][a[1]][-1].pose, both[b[0]][b[1]][0].pose)
        for a, b in product(runs, runs)
        if a[0] != b[0]
    }
    best, best_s = None, float("inf")
    for settings in permutations(range(len(views))):
        for ways in product((0, 1), repeat=len(views)):
            order = list(zip(settings, ways, strict=True))
            total_s = sum(within_s[k][way] for k, way in order)
            total_s += first_s[order[0]] if order else 0.0
            total_s += sum(next_s[pair] for pair in pairwise(order))
            if total_s < best_s - 1e-9:
                best, best_s = order, total_s
    return None if best is None else [step for k, way in best for step in both[k][way]]


def _within_s(order: Sequence[Step], moves_s: MovesS) -> float:
    return sum(moves_s(a.pose, b.pose) for a, b in pairwise(order))


def _nearest_next(start: Pose, views: Sequence[list[Step]], moves_s: MovesS) -> list[Step]:
    """Return the points with the nearest setting of the lamp always next."""
    left, found, pose = list(views), list[Step](), start
    while left:
        here = pose
        orders = [order for own in left for order in (own, own[::-1])]
        taken = min(orders, key=lambda order: _reaching_s(here, order, moves_s))
        for step in taken:
            if moves_s(pose, step.pose) < float("inf"):
                found.append(step)
                pose = step.pose
        left = [own for own in left if own[0].lamp_setting != taken[0].lamp_setting]
    return found


def _reaching_s(start: Pose, order: Sequence[Step], moves_s: MovesS) -> tuple[float, float]:
    """Return the lamp's time to the setting of an order, and the time of all its moves."""
    lamp_s = moves_s(start, order[0].pose._replace(theta_r=start.theta_r))
    return lamp_s, moves_s(start, order[0].pose) + _within_s(order, moves_s)
