"""Fewest geometries whose forecast u reach a goal, or what keeps all candidates from it."""

from __future__ import annotations

from acquisition.design.goal import Goal
from acquisition.design.optimal_plan import OptimalPlan, Planner
from instrument.errors import InputError


def fewest(planner: Planner, goal: Goal) -> OptimalPlan:
    """Choose as few geometries as reach the goal: with one fewer the u is missed.

    Raises `InputError` where all candidates together miss it, with the largest sources of error.
    """
    all_u, most = planner.every.u(), len(planner.points)
    missed = goal.missed(all_u)
    if missed:
        raise InputError(*(_unreachable(planner, goal, name, all_u[name]) for name in missed))
    low, high = len(planner.every.x) - 1, len(planner.every.x)
    while high < most and not _reaches(planner, goal, high):
        low, high = high, min(2 * high, most)
    while high - low > 1:
        middle = (low + high) // 2
        reached = _reaches(planner, goal, middle)
        low, high = (low, middle) if reached else (middle, high)
    return planner.optimal(high)


def _reaches(planner: Planner, goal: Goal, count: int) -> bool:
    """True if the plan of so many reaches the goal; a keep-out zone may bar it, then not."""
    try:
        planned = planner.chosen(count)[1]
    except InputError:
        return False
    return not goal.missed(planned.u)


def _unreachable(planner: Planner, goal: Goal, name: str, u: float) -> str:
    sources = list(planner.every.sources(name).items())[:3]
    parts = ", ".join(f"{100 * part:.0f} % {source}" for source, part in sources)
    return (
        f"--until {name}={goal.u[name]:g}: all {len(planner.points)} candidates together give a u "
        f"of {u:.3g}, of whose variance {parts}; allowed: more than that; what helps is a smaller "
        "u of the first (of noise: more frames_per_point), or another incidence in the sweeps"
    )
