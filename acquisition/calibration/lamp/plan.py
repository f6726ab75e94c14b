"""Plan of a lamp's calibration: how long it is watched, and what counts as steady."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from acquisition.measure.window import Window, window_at
from acquisition.terminal.console import duration_text
from analysis.calibration.lamp_drift import LEAST_READINGS
from instrument.config.axes import HandAxis
from instrument.config.rig import Rig
from instrument.errors import InputError
from instrument.geometry import BoolArray
from instrument.pinhole import Pinhole

TARGET = 0.4  # of full scale: room for a lamp that doubles its light
PICTURE_FRAMES = 16  # for the uniformity, and for the darks
_FURTHEST = 5.0  # times the time watched: a change is not foretold for longer
_STEP_DEG = 5.0  # between two points of a scan, on average (assumed)
_DARKER = 2.0  # times the exposure on the tile: that of a sample of half its light (assumed)
_FRAMES_OF_SCAN = 4
_RANGES = (
    ("minutes", 1.0, 720.0),
    ("every_s", 0.5, 600.0),
    ("frames", 2, 64),
    ("limit_percent", 0.001, 10.0),
    ("within_minutes", 0.5, 600.0),
    ("window_mm", 1.0, 1000.0),
    ("tile_mm", 1.0, 1000.0),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class LampPlan:
    """Times, sizes and pose of a calibration; the lamp is steady if its light changes by less.

    The change is that within `within_minutes`, `limit_percent` what is allowed. minutes: the
    longest time watched. frames: of each reading, one in `every_s`. window_mm, tile_mm: sides of
    the square that is watched, and of the tile. The angles are those at which the rig stands.
    """

    rig: Rig
    minutes: float = 30.0
    every_s: float = 10.0
    frames: int = 4
    limit_percent: float = 0.2
    within_minutes: float = 10.0
    window_mm: float = 20.0
    tile_mm: float = 50.0
    theta_i_deg: float = 30.0
    theta_r_deg: float = 0.0

    def __post_init__(self) -> None:
        """Refuse numbers with which nothing could be determined."""
        for name, low, high in _RANGES:
            value = getattr(self, name)
            if not low <= value <= high:
                self._refuse(name, f"{value:g}; allowed: {low:g} to {high:g}")
        if 60 * self.minutes < self.shortest_s:
            self._refuse(
                "minutes",
                f"{self.minutes:g} is too short; allowed with --every-s {self.every_s:g} and "
                f"--within-minutes {self.within_minutes:g}: at least {self.shortest_s / 60:.3g}",
            )
        if self.window_mm > self.tile_mm:
            self._refuse("window_mm", f"{self.window_mm:g}; allowed: up to that of the tile, "
                         f"--tile-mm {self.tile_mm:g}")  # fmt: skip
        self._require_pose()

    def _require_pose(self) -> None:
        """Refuse angles that the rig cannot have, or at which lamp or camera are in the way."""
        for name in ("theta_i", "theta_r"):
            value, axis = getattr(self, f"{name}_deg"), self.rig.axes[name]
            if not axis.min_deg <= value <= axis.max_deg:
                self._refuse(
                    f"{name}_deg", f"{value:g}; allowed: {axis.min_deg:g} to {axis.max_deg:g} deg"
                )
        apart, blocked = abs(self.theta_i_deg - self.theta_r_deg), self.rig.blocked_half_angle_deg
        if blocked is not None and apart < blocked:
            self._refuse("theta_r_deg", f"{self.theta_r_deg:g} is {apart:g} deg from the lamp; "
                         f"allowed: {blocked:g} or more")  # fmt: skip
        if not self.window.inside_frame:
            self._refuse("window_mm", f"{self.window_mm:g}: this square leaves the picture; "
                         "allowed: one within it")  # fmt: skip

    def _refuse(self, name: str, what: str) -> None:
        option = f"--{name.replace('_', '-')}"
        raise InputError(f"gonio calibrate lamp: {option} {what}. Nothing has been measured")

    @property
    def shortest_s(self) -> float:
        """Shortest time in s after which the lamp may be said to be steady."""
        return max(60 * self.within_minutes / _FURTHEST, self.every_s * (LEAST_READINGS - 1))

    @property
    def window(self) -> Window:
        """Window that is watched."""
        pinhole = Pinhole.of(self.rig)
        return window_at(self.theta_r_deg, pinhole, self.window_mm, self.window_mm)

    def patch(self) -> BoolArray:
        """Return True for the pixels (rows, columns) of the window."""
        mask = np.zeros((self.rig.camera.height_px, self.rig.camera.width_px), dtype=np.bool_)
        mask[self.window.crop] = self.window.counted
        return mask

    @property
    def limit(self) -> float:
        """Relative change that is allowed of a steady lamp."""
        return self.limit_percent / 100

    @property
    def within_s(self) -> float:
        """Time in s within which the light may change by no more than the limit."""
        return 60 * self.within_minutes

    def point_s(self, exposure_s: float) -> float:
        """Return the time in s of a point of a scan, for an exposure in s on the tile (assumed)."""
        axis, camera = self.rig.axes.theta_r, self.rig.camera
        frames_s = _FRAMES_OF_SCAN * (_DARKER * exposure_s + camera.frame_overhead_s)
        if isinstance(axis, HandAxis):
            return frames_s + axis.set_s
        return frames_s + _STEP_DEG / axis.speed_deg_per_s + axis.settle_s

    def lines(self) -> Iterator[str]:
        """Yield the plan in words."""
        rig = self.rig
        yield f"calibration of the lamp of the rig {rig.name}; nothing moves"
        yield (
            f"1. the operator places the white tile ({self.tile_mm:g} mm), with the lamp at theta_i"
            f" {self.theta_i_deg:g} and dphi 0 deg, the camera at theta_r {self.theta_r_deg:g} deg"
        )
        yield f"2. an exposure for {100 * TARGET:g} % of full scale; {PICTURE_FRAMES} darks"
        yield (
            f"3. lamp lit: the mean of {self.window_mm:g} x {self.window_mm:g} mm, {self.frames} "
            f"frames every {self.every_s:g} s, until it changes by less than "
            f"{self.limit_percent:g} % within {self.within_minutes:g} min (3 u), or "
            f"{self.minutes:g} min are over"
        )
        yield f"4. a picture of the tile, {PICTURE_FRAMES} frames; {PICTURE_FRAMES} darks"
        yield (
            f"takes {duration_text(self.shortest_s)} for a steady lamp, at most about "
            f"{duration_text(60 * self.minutes)}, beside the operator's work"
        )
