"""Reduction of the frames of a step to a row of the record."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict

from acquisition.engine.exposure.exposer import Exposed
from acquisition.interlocks.frame_scatter import FrameScatter
from acquisition.measure.placement import Placement
from acquisition.measure.plate.follower import PlateFollower
from acquisition.measure.radiometry import Signal, measure
from acquisition.measure.stray_light import View, with_dark_patch
from acquisition.measure.window import Window, window_at
from acquisition.plan.pose import Pose
from instrument.config.protocol import Protocol
from instrument.config.rig import Rig
from instrument.pinhole import Pinhole
from instrument.record.reading import Reading


class FrameReduction:
    """Averages the window of a step's frames.

    `scatter` judges how they differ; `note` is told where markers show the sample's plate.
    """

    def __init__(
        self, rig: Rig, protocol: Protocol, scatter: FrameScatter, note: Callable[[str], None]
    ) -> None:
        self._rig, self._patch, self._scatter = rig, protocol.window, scatter
        self._pinhole = Pinhole.of(rig)
        self._plate = PlateFollower(self._pinhole, protocol, note)

    def window(self, pose: Pose) -> Window:
        """Return the window at a pose; perpendicular to the sample if the view angle is unknown."""
        known = 0.0 if math.isnan(pose.theta_r) else pose.theta_r
        return window_at(known, self._pinhole, self._patch.width_mm, self._patch.height_mm)

    def window_of(self, exposed: Exposed) -> Window:
        """Return the window of a step's frames, which follows the plate of the sample."""
        step = exposed.step
        return self._plate.window(exposed.frames[0].image, step.pose.theta_r, step.surface)

    def reading(self, exposed: Exposed) -> Reading:
        """Return the row of the record for the frames of a step."""
        step, rig = exposed.step, self._rig
        window, least = self.window_of(exposed), self._patch.min_pixels
        placement = Placement(rig.u_placement_mm, step.pose.theta_i, rig.lamp_distance_mm)
        signal = measure(exposed.frames, exposed.dark, window, rig.camera, placement, least)
        signal = self._scatter.judged(
            signal, exposed.frames, exposed.dark, window, f"step {step.index}"
        )
        view = View(rig, self._patch, step.pose.theta_i, step.pose.theta_r)
        return _reading(exposed, with_dark_patch(signal, exposed.frames, exposed.dark, view))


def _reading(exposed: Exposed, signal: Signal) -> Reading:
    step, first = exposed.step, exposed.frames[0]
    return Reading(
        step=step.index,
        kind=step.kind,
        surface=step.surface,
        theta_i_deg=step.pose.theta_i,
        dphi_deg=step.pose.dphi,
        theta_r_deg=step.pose.theta_r,
        lamp_setting=step.lamp_setting,
        block=step.block,
        exposure_s=first.exposure_s,
        frames=len(exposed.frames),
        time_s=exposed.time_s,
        free_s=exposed.free_s,
        time_utc=exposed.time_utc,
        blur_deg=exposed.turn.blur_deg,
        u_turn_deg=exposed.turn.u_deg,
        u_latency_deg=exposed.turn.u_latency_deg,
        **asdict(signal),
    )
