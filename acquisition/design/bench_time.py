"""Time on the bench for each candidate and each setting of the lamp, from the plan of all.

The plan of the chosen ones has its own duration; these times are for choosing.
"""

from __future__ import annotations

import numpy as np

from acquisition.plan.plan import Plan, Step, frames_s
from analysis.design.optimal import Costs
from instrument.config.axes import HandAxis
from instrument.config.load import Loaded
from instrument.geometry import BoolArray


def bench_time(loaded: Loaded, plan: Plan, used: BoolArray) -> Costs:
    """Return the times of the plan's points marked in `used` (points,), in seconds.

    A setting of the lamp costs its moves, its reading of the white tile, and where it is set by
    hand the swaps of sample and tile. A point costs its frames, a usual move of the camera, and its
    share of the drift checks. What every scan takes, such as homing, is fixed.
    """
    usual_s = float(np.median([_moves_s(step, "theta_r") for step in plan.points]))
    points = [step for step, kept in zip(plan.points, used, strict=True) if kept]
    settings = np.unique([step.lamp_setting for step in points], return_inverse=True)
    setting_s = [_setting_s(loaded, plan, int(number), usual_s) for number in settings[0]]
    share_s = _drift_s(loaded, plan)
    point_s = [_frames_s(loaded, step) + min(_moves_s(step, "theta_r"), usual_s) for step in points]
    return Costs(
        point_s=np.array(point_s) + share_s,
        setting=settings[1].reshape(-1).astype(np.int64),
        setting_s=np.array(setting_s),
        fixed_s=plan.steps[0].start_s + 2 * loaded.rig.swap_s,
    )


def _frames_s(loaded: Loaded, step: Step) -> float:
    return frames_s(step.frames, step.expected_exposure_s, loaded.rig)


def _moves_s(step: Step, *axes: str) -> float:
    return sum(move.duration_s for move in step.moves if move.axis in axes)


def _setting_s(loaded: Loaded, plan: Plan, number: int, usual_s: float) -> float:
    """Return the time of a setting of the lamp, with the camera's way to its first point."""
    steps = [step for step in plan.steps if step.lamp_setting == number and step.kind != "drift"]
    tiles = [step for step in steps if step.kind == "tile"]
    points = [_moves_s(step, "theta_r") for step in steps if step.kind == "point"]
    readings = sum(_frames_s(loaded, step) + _moves_s(step, "theta_r") for step in tiles)
    lamp = sum(_moves_s(step, "theta_i", "dphi") for step in steps)
    axes = (loaded.rig.axes["theta_i"], loaded.rig.axes["dphi"])
    by_hand = any(isinstance(axis, HandAxis) for axis in axes)
    way_s = max(0.0, points[0] - usual_s) if points else 0.0
    return readings + lamp + way_s + (loaded.rig.swap_s if by_hand else 0.0)


def _drift_s(loaded: Loaded, plan: Plan) -> float:
    """Return the share of one point in the time of the drift checks."""
    checks = [step for step in plan.steps if step.kind == "drift"]
    total = sum(_frames_s(loaded, step) + _moves_s(step, "theta_r") for step in checks)
    return total / len(plan.points)
