"""Curves of a scan: the angle that its sweeps move, and the curve that a geometry belongs to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

from acquisition.plan.plan import Plan
from acquisition.plan.pose import Pose

SIGNS = {"theta_i": "θᵢ", "dphi": "Δφ", "theta_r": "θᵣ"}
"""Angles as the page calls them."""
_MOST_LIKELY = ("theta_r", "theta_i", "dphi")  # where several angles change equally often


class Angles(Protocol):
    """Geometry of a reading, in degrees."""

    @property
    def theta_i_deg(self) -> float:
        """Angle of incidence."""

    @property
    def dphi_deg(self) -> float:
        """Azimuth between lamp and camera."""

    @property
    def theta_r_deg(self) -> float:
        """View angle."""


@dataclass(frozen=True, slots=True)
class Curves:
    """Curves of a plan's points over `sweep`, the angle that changes from one to the next.

    named: the angles in a curve's name. range_deg: the smallest and largest angle of the sweep.
    """

    sweep: str
    named: tuple[str, ...]
    range_deg: tuple[float, float]

    @classmethod
    def of(cls, plan: Plan) -> Curves:
        """Return the curves of a plan."""
        poses = [step.pose for step in plan.points]
        sweep = max(_MOST_LIKELY, key=lambda name: _changes(poses, name))
        others = [name for name in SIGNS if name != sweep]
        varied = [name for name in others if _changes(poses, name)]
        always = "theta_r" if sweep == "theta_i" else "theta_i"
        named = tuple(name for name in others if name in varied or name == always)
        along = [getattr(pose, sweep) for pose in poses]
        return cls(sweep, named, (min(along), max(along)))

    def name_of(self, reading: Angles) -> str:
        """Return the name of the curve that a reading belongs to."""
        return ", ".join(f"{SIGNS[n]} {getattr(reading, f'{n}_deg'):g}°" for n in self.named)

    def x_deg(self, reading: Angles) -> float:
        """Return the place of a reading along its curve, in degrees."""
        return float(getattr(reading, f"{self.sweep}_deg"))


def _changes(poses: Sequence[Pose], name: str) -> int:
    """Return how often an angle changes from one point to the next."""
    angles = [getattr(pose, name) for pose in poses]
    return sum(a != b for a, b in pairwise(angles))
