"""Pose: angles that are unknown after homing."""

from __future__ import annotations

from acquisition.plan.pose import home_pose
from tests.support.random_plans import base


def test_the_angle_of_a_hand_set_axis_is_unknown_after_homing() -> None:
    pose = home_pose(base("paper_1995").rig)
    assert pose.theta_i != pose.theta_i
    assert pose.theta_r == 0.0
