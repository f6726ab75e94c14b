"""Pose of the rig: the angles of its three axes."""

from __future__ import annotations

from typing import NamedTuple

from instrument.config.axes import AXES, HandAxis
from instrument.config.rig import Rig
from instrument.geometry import camera_to_lamp_deg


class Pose(NamedTuple):
    """Angles of the axes in the rig's degrees (theta_r signed); nan where an angle is unknown."""

    theta_i: float
    dphi: float
    theta_r: float

    @property
    def separation_deg(self) -> float:
        """Angle between the directions of camera and lamp."""
        return float(camera_to_lamp_deg(self.theta_i, self.theta_r, self.dphi))

    def __str__(self) -> str:
        return f"theta_i {self.theta_i:g}, dphi {self.dphi:g}, theta_r {self.theta_r:g} deg"


def home_pose(rig: Rig) -> Pose:
    """Return the pose after homing, in which the angle of a hand-set axis is unknown (nan)."""
    axes = (rig.axes[name] for name in AXES)
    return Pose(*(float("nan") if isinstance(a, HandAxis) else a.home_deg for a in axes))
