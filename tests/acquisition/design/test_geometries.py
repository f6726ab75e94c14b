"""Geometries of a protocol: candidates between them, even parts, the quicker order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.design.bench_time import bench_time
from acquisition.design.geometries import (
    MOST,
    candidate_plan,
    evenly,
    grouped,
    quicker,
    refined,
    settings_of,
    uniform,
    with_settings,
)
from acquisition.plan.plan import make_plan
from acquisition.plan.pose import Pose
from instrument.config.load import Loaded
from instrument.config.rig import KeepOut
from tests.support.random_plans import base


def test_candidates_are_the_views_and_those_halfway_between() -> None:
    assert refined({(30.0, 0.0): [-10.0, 0.0, 30.0]}) == {
        (30.0, 0.0): [-10.0, -5.0, 0.0, 15.0, 30.0]
    }


@pytest.mark.parametrize(("settings", "views"), [(1, 5000), (40, 40), (2000, 3), (1, 400)])
def test_candidates_of_many_geometries_are_an_even_part_of_them(settings: int, views: int) -> None:
    many = {(float(k), 0.0): np.linspace(-80, 80, views).tolist() for k in range(settings)}
    found = refined(many)
    assert MOST // 4 < sum(map(len, found.values())) <= MOST
    for setting, own in found.items():
        assert set(own) <= set(many[setting])
        assert (own[0], own[-1]) == (-80.0, 80.0) or len(own) < 2


def test_an_even_part_keeps_both_ends() -> None:
    assert evenly([0.0, 1.0, 2.0, 3.0, 4.0], 3) == [0.0, 2.0, 4.0]
    assert evenly([0.0, 1.0], 3) == [0.0, 1.0]
    assert evenly([0.0, 1.0, 2.0], 1) == [1.0]


def test_uniform_sweeps_reach_from_the_first_view_to_the_last() -> None:
    found = uniform({(30.0, 0.0): [-60.0, 0.0, 80.0], (45.0, 0.0): [20.0]}, 3)
    assert found == {(30.0, 0.0): [-60.0, 10.0, 80.0], (45.0, 0.0): [20.0]}


@pytest.mark.parametrize("rig", ["bench_12bit", "paper_1995"])
def test_a_chosen_part_is_planned_in_the_quicker_of_two_orders(rig: str) -> None:
    loaded = base(rig)
    own = settings_of(make_plan(loaded))
    few = {setting: views[::4] for setting, views in own.items()}
    chosen, plan = quicker(loaded, few)
    assert plan.duration_s <= make_plan(with_settings(loaded, few)).duration_s
    assert grouped(step.pose for step in plan.points) == few
    assert len(chosen.protocol.sweeps) == len(few)


def test_candidates_keep_away_from_a_zone_between_the_views(small: Loaded) -> None:
    """Where a view between the protocol's own is not free, its own are the candidates."""
    zone = KeepOut(name="post", theta_i_deg=[28.0, 32.0], theta_r_deg=[50.0, 54.0])
    near = with_settings(small, {(30.0, 0.0): [0.0, 35.0], (60.0, 0.0): [0.0, 35.0, 70.0]})
    blocked = near.rig.model_copy(update={"keep_out": [zone]})
    loaded = replace(near, rig=blocked)
    plan = candidate_plan(loaded, make_plan(loaded))[1]
    poses = {step.pose for step in plan.points}
    assert Pose(30.0, 0.0, 0.0) in poses
    assert not [pose for pose in poses if pose.theta_i == 30 and 50 <= pose.theta_r <= 54]


@pytest.mark.parametrize("rig", ["bench_12bit", "paper_1995"])
def test_the_times_of_all_points_are_about_the_duration_of_the_plan(rig: str) -> None:
    loaded = base(rig)
    plan = make_plan(loaded)
    used = np.ones(len(plan.points), dtype=bool)
    costs = bench_time(loaded, plan, used)
    assert costs.total_s(used) == pytest.approx(plan.duration_s, rel=0.15)


def test_a_lamp_that_is_set_by_hand_is_dear() -> None:
    motor, hand = (
        bench_time(loaded, plan, np.ones(len(plan.points), dtype=bool))
        for loaded in (base("bench_12bit"), base("paper_1995"))
        for plan in (make_plan(loaded),)
    )
    assert hand.setting_s.min() > 3 * motor.setting_s.max()
    assert hand.setting_s.min() > 8 * hand.point_s.max()
