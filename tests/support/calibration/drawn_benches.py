"""Simulated bench with a drawn geometry, its calibration, and the truth of each value."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.calibration.geometry.plan import GeometryPlan
from acquisition.calibration.geometry.procedure import GeometryCalibrator
from acquisition.calibration.geometry.result import geometry_of
from acquisition.engine.positioner import Positioner
from acquisition.rig import OpenRig
from instrument.board import Board
from instrument.calibration.geometry_file import GeometryCalibration
from instrument.config.axes import AXES
from instrument.config.load import load_rig
from instrument.config.rig import Rig
from instrument.geometry import FloatArray
from sim.scene.scene import Scene
from tests.support.paths import CONFIGS

REAL = CONFIGS / "rigs" / "bench_real.yaml"


def drawn_rig(seed: int, path: Path = REAL) -> Rig:
    """Return bench_real with all defects drawn, and the camera's geometry too."""
    rig, rng = load_rig(path), np.random.default_rng(seed)
    changes: dict[str, Any] = {
        "field_width_mm": 72.0 * (1 + 0.01 * rng.standard_normal()),
        "axis_column_px": 317.0 + 6 * rng.standard_normal(),
        "axis_row_px": 257.5 + 6 * rng.standard_normal(),
        "roll_deg": rng.standard_normal(),
    }
    simulation = rig.simulation.model_copy(update={"seed": seed, "drawn": True})
    camera = rig.camera.model_copy(update=changes)
    beam_mm = 800.0 * (1 + 0.01 * rng.standard_normal())
    update = {"camera": camera, "simulation": simulation, "beam_length_mm": beam_mm}
    return rig.model_copy(update=update)


def calibrated(
    truth: Rig, stated: Rig, lies: Board | None = None, **options: Any
) -> GeometryCalibration:
    """Return the calibration of a simulated rig, of which the plan knows what a file states.

    `lies`: the board that lies there, if it is another one than the plan's.
    """
    plan = GeometryPlan(rig=stated, **options)
    with OpenRig(truth, board=lies or plan.board) as rig:
        axes, camera = {name: rig.axis(name) for name in AXES}, rig.camera()
        positioner = Positioner(stated, axes, rig.lamp, rig.operator, lambda _: None)
        calibrator = GeometryCalibrator(
            plan=plan, camera=camera, lamp=rig.lamp, positioner=positioner,
            operator=rig.operator, say=lambda _: None,
        )  # fmt: skip
        positioner.home()
        return geometry_of(
            calibrator.measure(), plan, camera=camera.identity(),
            stage=axes["theta_r"].identity(), skipped=calibrator.skipped, now=datetime.now(UTC),
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Lasting:
    """Errors of the axis in degrees, and shifts of the picture's rows, at each angle (n,)."""

    zero_deg: FloatArray
    rows_px: FloatArray


def _lasting(truth: Rig, angles_deg: FloatArray) -> _Lasting:
    """Return what the axis does at each angle apart from its random error."""
    axis = truth.axes.theta_r.model_copy(update={"u_deg": 0.0})
    axes = truth.axes.model_copy(update={"theta_r": axis})
    scene = Scene.of_white_sample(truth.model_copy(update={"axes": axes}))
    errors, rows = [], []
    for angle_deg in angles_deg.tolist():
        scene.set_axis("theta_r", angle_deg)
        errors.append(scene.true_deg["theta_r"] - angle_deg)
        rows.append(scene.picture_shift()[1, 2])
    return _Lasting(np.array(errors), np.array(rows))


def true_values(truth: Rig, angles_deg: FloatArray) -> dict[str, float]:
    """Return the truth by the key of the quantity.

    A cycle of the axis and a wobble of the beam count by their means over the poses.
    """
    scene = Scene.of_white_sample(truth)
    simulation, camera = scene.rig.simulation, truth.camera
    lasting, own = _lasting(truth, angles_deg), simulation.sample_placement
    return {
        "field_width_mm": camera.field_width_mm,
        "beam_length_mm": truth.beam_length_mm,
        "axis_column_px": camera.axis_column_px,
        "axis_row_px": camera.axis_row_px + float(lasting.rows_px.mean()),
        "roll_deg": camera.roll_deg,
        "distortion_percent": 100 * simulation.lens_defects.distortion,
        "theta_r_zero_error_deg": float(lasting.zero_deg.mean()),
        "table_lean_deg": 0.0,
        "height_mm": simulation.sample_height_mm,
        "lean_deg": own.tilt_deg,
        "lean_across_deg": own.tilt_across_deg,
    }
