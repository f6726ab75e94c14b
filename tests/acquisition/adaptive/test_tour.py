"""Order of the points of a batch: each once, and no other order of its kind is quicker."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest

from acquisition.adaptive.layout import Layout
from acquisition.adaptive.tour import tour
from acquisition.plan.plan import Step, make_plan
from tests.support.adaptive.predicted_bench import adaptive_scan

SEEDS = range(6)


@pytest.fixture(scope="module")
def layout() -> Layout:
    loaded = adaptive_scan("sigma_deg=0.1", incidences=(15.0, 30.0, 45.0, 60.0, 75.0), views=9)
    return Layout(make_plan(loaded), loaded)


def _drawn(layout: Layout, seed: int) -> tuple[Step, list[Step]]:
    rng, points = np.random.default_rng(seed), layout.plan.points
    start, *own = rng.permutation(len(points))[: 4 + 3 * seed].tolist()
    most = 3 + seed % 3  # settings of the lamp: all orders are compared up to 4
    settings = sorted({points[k].lamp_setting for k in own})[:most]
    return points[start], [points[k] for k in own if points[k].lamp_setting in settings]


def _seconds(layout: Layout, start: Step, way: Sequence[Step]) -> float:
    return sum(layout.moves_s(a.pose, b.pose) for a, b in pairwise([start, *way]))


@pytest.mark.parametrize("seed", SEEDS)
def test_every_point_is_there_once_and_the_views_of_a_setting_rise_or_fall(
    seed: int, layout: Layout
) -> None:
    start, points = _drawn(layout, seed)
    way = tour(start.pose, points, layout.moves_s)
    assert sorted(step.index for step in way) == sorted(step.index for step in points)
    settings = [step.lamp_setting for step in way]
    assert len([*dict.fromkeys(settings)]) == 1 + sum(a != b for a, b in pairwise(settings))
    for setting in set(settings):
        views = [step.pose.theta_r for step in way if step.lamp_setting == setting]
        assert views in (sorted(views), sorted(views, reverse=True))


@pytest.mark.parametrize("seed", [s for s in SEEDS if s % 3 != 2])
def test_no_random_order_is_quicker(seed: int, layout: Layout) -> None:
    start, points = _drawn(layout, seed)
    own_s = _seconds(layout, start, tour(start.pose, points, layout.moves_s))
    rng = np.random.default_rng(seed)
    for _ in range(40):
        other = list[Step]()
        for setting in rng.permutation(sorted({step.lamp_setting for step in points})):
            own = sorted((s for s in points if s.lamp_setting == setting), key=_view)
            other += own if rng.integers(2) else own[::-1]
        assert own_s <= _seconds(layout, start, other) + 1e-9


def _view(step: Step) -> float:
    return step.pose.theta_r


@pytest.mark.parametrize("seed", SEEDS)
def test_drift_checks_are_never_late(seed: int, layout: Layout) -> None:
    drift = layout.loaded.protocol.references.drift_check
    assert drift is not None
    rng, known = np.random.default_rng(seed), list[Step]()
    points = [layout.plan.points[k] for k in rng.permutation(len(layout.plan.points))[:70]]
    while points:
        size = int(rng.integers(1, 30))
        part, points = points[:size], points[size:]
        known += layout.batch(layout.way(known, part), known)
    since = 0
    for step in known:
        since = 0 if step.kind == "drift" else since + (step.kind == "point")
        assert since <= drift.every_points
    assert sum(step.kind == "point" for step in known) == 70
    assert len({step.index for step in known}) == len(known)
