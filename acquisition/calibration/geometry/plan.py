"""Plan of a geometry calibration: the poses at which the board is seen, each within the limits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from acquisition.plan.moves import NoPathError, moves_between
from acquisition.plan.pose import Pose, home_pose
from instrument.board import Board
from instrument.config.axes import HandAxis
from instrument.config.rig import Rig
from instrument.errors import InputError
from instrument.pinhole import Pinhole, rectangle_mm

TARGET = 0.6  # of full scale: white paper
LEAST_POSES = 5
LEAST_SPAN_DEG = 60.0
"""Between the outermost view angles: with less, foreshortening tells too little."""
_RANGES = (("poses", LEAST_POSES, 60), ("frames", 1, 64), ("widest_deg", 30.0, 75.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class GeometryPlan:
    """Poses of a calibration: `poses` view angles from -widest_deg to widest_deg.

    frames: of each picture. u_square_mm: of the board's squares. theta_i_deg, dphi_deg: of the
    lamp, which lights the board and stays where it is.
    """

    rig: Rig
    board: Board = field(default_factory=Board)
    u_square_mm: float = 0.02
    poses: int = 13
    widest_deg: float = 60.0
    frames: int = 4
    theta_i_deg: float = 30.0
    dphi_deg: float = 0.0

    def __post_init__(self) -> None:
        """Refuse numbers and poses that the rig cannot do."""
        for name, low, high in _RANGES:
            value = getattr(self, name)
            if not low <= value <= high:
                self._refuse(name, f"{value:g}; allowed: {low:g} to {high:g}")
        if not 0 <= self.u_square_mm <= 0.1 * self.board.square_mm:
            most = f"{0.1 * self.board.square_mm:g}"
            self._refuse("u_square_mm", f"{self.u_square_mm:g}; allowed: 0 to {most} mm")
        for name, value in (("theta_i", self.theta_i_deg), ("dphi", self.dphi_deg)):
            self._require_limits(name, value, f"{name}_deg")
        for value in (-self.widest_deg, self.widest_deg):
            self._require_limits("theta_r", value, "widest_deg")
        self._require_picture()
        self._require_poses()

    def _require_limits(self, axis: str, value: float, option: str) -> None:
        limits = self.rig.axes[axis]
        if not limits.min_deg <= value <= limits.max_deg:
            self._refuse(
                option,
                f"{getattr(self, option):g}: {axis} would go to {value:g} deg; allowed by the rig: "
                f"{limits.min_deg:g} to {limits.max_deg:g} deg",
            )

    def _require_picture(self) -> None:
        """Refuse a board that leaves the picture, by the camera of the rig file."""
        pinhole = Pinhole.of(self.rig)
        squares = (side * self.board.square_mm for side in (self.board.columns, self.board.rows))
        seen = pinhole.project(rectangle_mm(*squares), 0.0)
        inside = (seen >= 0) & (seen <= [pinhole.width_px - 1, pinhole.height_px - 1])
        if not inside.all():
            self._refuse(
                "square_mm",
                f"{self.board.square_mm:g}: {self.board} leave the picture, "
                f"{self.rig.camera.field_width_mm:g} mm wide; allowed: a board within it",
            )

    def _require_poses(self) -> None:
        usable = [pose.theta_r for pose in self.usable()]
        if len(usable) < LEAST_POSES or usable[-1] - usable[0] < LEAST_SPAN_DEG:
            left = "; ".join(why for _, why in self.left_out()) or "none is left out"
            self._refuse(
                "poses",
                f"{self.poses}: {len(usable)} of them can be used; needed: {LEAST_POSES}, over "
                f"{LEAST_SPAN_DEG:g} deg or more ({left})",
            )

    def _refuse(self, name: str, what: str) -> None:
        option = f"--{name.replace('_', '-')}"
        raise InputError(f"gonio calibrate geometry: {option} {what}. Nothing has moved")

    def _all(self) -> list[Pose]:
        angles = np.linspace(-self.widest_deg, self.widest_deg, self.poses)
        return [Pose(self.theta_i_deg, self.dphi_deg, round(a, 4)) for a in angles.tolist()]

    def usable(self) -> list[Pose]:
        """Return the poses that can be reached one after the other, and see the board."""
        return [pose for pose, why in self._judged() if not why]

    def left_out(self) -> list[tuple[Pose, str]]:
        """Return the poses that are left out, each with the reason."""
        return [(pose, why) for pose, why in self._judged() if why]

    def _judged(self) -> Iterator[tuple[Pose, str]]:
        """Yield each pose, and why it is left out, empty if it is not."""
        at, blocked = home_pose(self.rig), self.rig.blocked_half_angle_deg
        for pose in self._all():
            why = ""
            if blocked is not None and pose.separation_deg < blocked:
                why = f"theta_r {pose.theta_r:g}: {pose.separation_deg:g} deg from the lamp"
            else:
                try:
                    moves_between(at, pose, self.rig)
                    at = pose
                except NoPathError as error:
                    why = f"theta_r {pose.theta_r:g}: {error.cause}"
            yield pose, why

    def lines(self) -> Iterator[str]:
        """Yield the plan in words."""
        usable = self.usable()
        angles = ", ".join(f"{pose.theta_r:g}" for pose in usable)
        yield f"calibration of the geometry of the rig {self.rig.name}"
        yield f"1. the operator lays the board in the sample's place: {self.board}"
        yield f"2. lamp to theta_i {self.theta_i_deg:g}, dphi {self.dphi_deg:g} deg, and stays"
        yield f"3. theta_r to {len(usable)} angles, {self.frames} frames at each: {angles} deg"
        yield "4. the operator turns the board by half a turn in its plane; theta_r goes back"
        for _, why in self.left_out():
            yield f"left out: {why}"
        hand = [n for n in ("theta_i", "dphi", "theta_r") if isinstance(self.rig.axes[n], HandAxis)]
        if hand:
            yield f"set by hand, when asked: {', '.join(hand)}"
