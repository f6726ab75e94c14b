"""Geometries of a protocol by lamp setting: between its own, fewer, or a chosen few.

The result is always a protocol like the given one with other sweeps, one for each setting of the
lamp, which is planned and checked as any other.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np

from acquisition.plan.plan import Plan, make_plan
from acquisition.plan.pose import Pose
from instrument.config.load import Loaded
from instrument.config.protocol import SweepConfig
from instrument.errors import InputError

MOST = 600
"""Candidates, among which all pairs are compared."""

_DECIMALS = 4  # of a view angle in degrees: a written protocol shows them

Settings = Mapping[tuple[float, float], list[float]]
"""View angles by setting of the lamp (theta_i, dphi), all in degrees."""


def settings_of(plan: Plan) -> dict[tuple[float, float], list[float]]:
    """Return the view angles of a plan's points, rising, by setting of the lamp in its order."""
    found: dict[tuple[float, float], list[float]] = {}
    for step in plan.points:
        found.setdefault((step.pose.theta_i, step.pose.dphi), []).append(step.pose.theta_r)
    return {
        setting: sorted({round(view, _DECIMALS) for view in views})
        for setting, views in found.items()
    }


def grouped(poses: Iterable[Pose]) -> dict[tuple[float, float], list[float]]:
    """Return the view angles of poses, rising, by setting of the lamp."""
    found: dict[tuple[float, float], list[float]] = {}
    for pose in poses:
        found.setdefault((pose.theta_i, pose.dphi), []).append(pose.theta_r)
    return {setting: sorted(views) for setting, views in found.items()}


def with_settings(loaded: Loaded, settings: Settings) -> Loaded:
    """Return the protocol with one sweep for each setting of the lamp."""
    sweeps: list[SweepConfig] = [
        {"theta_i_deg": [theta_i], "dphi_deg": [dphi], "theta_r_deg": list(views)}
        for (theta_i, dphi), views in settings.items()
    ]
    return replace(loaded, protocol=loaded.protocol.model_copy(update={"sweeps": sweeps}))


def quicker(loaded: Loaded, settings: Settings) -> tuple[Loaded, Plan]:
    """Return the protocol and plan of these views that take less time.

    Either each sweep rises, so that no move has to take up backlash, or every other one falls, so
    that the camera need not return. Raises `InputError` where no move leads to a geometry.
    """
    falling = {
        setting: views[::-1] if number % 2 else views
        for number, (setting, views) in enumerate(settings.items())
    }
    plans, errors = [], []
    for one in (settings, falling):
        try:
            ordered = with_settings(loaded, one)
            plans.append((ordered, make_plan(ordered)))
        except InputError as error:  # a keep-out zone may bar one order and not the other
            errors.append(error)
    if not plans:
        raise errors[0]
    return min(plans, key=lambda pair: pair[1].duration_s)


def refined(settings: Settings) -> dict[tuple[float, float], list[float]]:
    """Return candidates: the views and those halfway between them, or fewer than `MOST` of many."""
    total = sum(len(views) for views in settings.values())
    if total > MOST:
        return _thinned(settings, MOST)
    finer = {setting: _with_middles(views) for setting, views in settings.items()}
    return finer if sum(map(len, finer.values())) <= MOST else dict(settings)


def _with_middles(views: list[float]) -> list[float]:
    middles = [round((a + b) / 2, _DECIMALS) for a, b in pairwise(views)]
    return sorted([*views, *middles])


def _thinned(settings: Settings, most: int) -> dict[tuple[float, float], list[float]]:
    """Return an even part of the settings, and of the views of each."""
    if len(settings) > most // 2:
        every = list(settings)
        kept = np.unique(np.linspace(0, len(every) - 1, most // 2).round()).astype(int)
        settings = {every[k]: settings[every[k]] for k in kept}
    count = max(most // len(settings), 1)
    return {setting: evenly(views, count) for setting, views in settings.items()}


def evenly(views: list[float], count: int) -> list[float]:
    """Return `count` of the views, or all if there are fewer, spread evenly among them."""
    if count >= len(views):
        return list(views)
    if count == 1:
        return [views[len(views) // 2]]
    return [views[k] for k in np.linspace(0, len(views) - 1, count).round().astype(int)]


def uniform(settings: Settings, count: int) -> dict[tuple[float, float], list[float]]:
    """Return sweeps of `count` evenly spaced views from the first to the last of each setting."""
    return {
        setting: np.linspace(views[0], views[-1], count if len(views) > 1 else 1).tolist()
        for setting, views in settings.items()
    }


def candidate_plan(loaded: Loaded, plan: Plan) -> tuple[Loaded, Plan]:
    """Return the protocol and the plan of all candidates.

    Where a view between the protocol's own cannot be reached, its own alone are candidates.
    """
    own = settings_of(plan)
    try:
        finer = with_settings(loaded, refined(own))
        return finer, make_plan(finer)
    except InputError:  # a keep-out zone between two views, which the protocol's order goes around
        coarse = with_settings(loaded, _thinned(own, MOST))
        return coarse, make_plan(coarse)
