"""Commands `gonio calibrate ...`: measure devices and write what was found.

Only that of the geometry moves the axes of a real rig.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from acquisition.calibration.geometry.board_page import board_pdf
from acquisition.calibration.geometry.plan import GeometryPlan
from acquisition.calibration.geometry.procedure import GeometryCalibrator
from acquisition.calibration.geometry.result import geometry_of
from acquisition.calibration.geometry.summary import geometry_json, geometry_lines
from acquisition.calibration.lamp.plan import LampPlan
from acquisition.calibration.lamp.result import lamp_calibration_of
from acquisition.calibration.lamp.summary import lamp_json, lamp_lines
from acquisition.calibration.lamp.watch import LampWatcher
from acquisition.calibration.plan import CalibrationPlan
from acquisition.calibration.procedure import CameraCalibrator
from acquisition.calibration.result import calibration_of
from acquisition.calibration.summary import summary_json, summary_lines
from acquisition.commands.setup import confirm, require_rig, stopped_at_an_error
from acquisition.engine.positioner import Positioner
from acquisition.rig import (
    OpenRig,
    require_calibration_date,
    require_own_calibration,
    restart_for_emulated_camera,
)
from acquisition.terminal.console import console, out, print_lines, print_notes
from acquisition.terminal.operator import require_terminal
from acquisition.terminal.orderly_end import orderly_end
from instrument.board import Board
from instrument.calibration.archive import SUFFIX
from instrument.calibration.camera_calibration import CameraCalibration
from instrument.calibration.camera_file import write_camera_file
from instrument.calibration.geometry_file import GeometryCalibration, write_geometry_file
from instrument.calibration.lamp_file import LampCalibration, write_lamp_file
from instrument.config.axes import AXES
from instrument.config.rig import Rig
from instrument.errors import InputError
from instrument.text.atomic_file import write_whole

_WHITE_FILLS = 3.0  # widths of the picture: size of the white surface in a scene


def calibrate_camera(
    rig_path: Path | None,
    path: Path | None,
    *,
    exposures: int,
    frames: int,
    plan_only: bool,
    as_json: bool,
) -> None:
    """Calibrate the camera of a rig and write the file `path`; `plan_only`: only say how."""
    rig = require_rig(rig_path)
    plan = CalibrationPlan(rig=rig, exposures=exposures, frames=frames)
    if plan_only:
        print_lines(plan.lines())
        return
    path = _require_path(path, "camera")
    _require_somebody(rig, rig_path)
    with orderly_end():
        calibration = _measured(plan)
        written = write_camera_file(path, calibration)
    found = summary_json(written, str(path))
    _print(written, found, summary_lines(written, rig, out.width), path, as_json)


def _require_somebody(rig: Rig, rig_path: Path | None) -> None:
    """Refuse a real rig without a terminal; start again where the camera is an emulated one."""
    if rig.real:
        require_terminal(str(rig_path))
    restart_for_emulated_camera(rig)


def _require_path(path: Path | None, device: str) -> Path:
    """Return the path of the file to be; raise `InputError` before anything is measured."""
    if path is None:
        raise InputError(f"gonio calibrate {device}: name the file to write: -o FILE.npz")
    if path.suffix != SUFFIX:
        raise InputError(f"{path}: the file's name must end in {SUFFIX}")
    if path.exists():
        raise InputError(
            f"{path}: exists already, and runs may name it: choose another name, as with the date"
        )
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}: make it first")
    return path


def _measured(plan: CalibrationPlan) -> CameraCalibration:
    rig = plan.rig
    white_mm = _WHITE_FILLS * rig.camera.field_width_mm
    with OpenRig(rig, white_mm=white_mm) as open_rig:
        open_rig.pose_scene(0.0)
        camera = open_rig.camera()
        calibrator = CameraCalibrator(
            plan=plan, camera=camera, lamp=open_rig.lamp, operator=open_rig.operator, say=_say
        )
        measured = calibrator.measure()
        return calibration_of(measured, rig, camera, datetime.now(UTC))


def _say(text: str) -> None:
    console.print(text, highlight=False, soft_wrap=True)


def _print(
    calibration: CameraCalibration | LampCalibration | GeometryCalibration,
    found: Mapping[str, object],
    lines: Iterable[str],
    path: Path,
    as_json: bool,
) -> None:
    """Print what was found as JSON, or its lines, the notes and the file."""
    if as_json:
        sys.stdout.write(json.dumps(found) + "\n")
        return
    print_lines(lines)
    print_notes(calibration.notes)
    print_lines([f"file: {path} (sha256 {calibration.sha256[:16]}...)"])


def calibrate_lamp(
    rig_path: Path | None,
    path: Path | None,
    options: Mapping[str, Any],
    *,
    plan_only: bool,
    as_json: bool,
) -> None:
    """Calibrate the lamp of a rig and write the file `path`; `plan_only`: only say how.

    `options` of `LampPlan`, by their names.
    """
    rig = require_rig(rig_path, calibrated=True)
    plan = LampPlan(rig=rig, **options)
    if plan_only:
        print_lines(plan.lines())
        return
    path = _require_path(path, "lamp")
    _require_somebody(rig, rig_path)
    with orderly_end():
        written = write_lamp_file(path, _watched(plan, rig_path or Path()))
    found = lamp_json(written, str(path))
    _print(written, found, lamp_lines(written, rig, out.width), path, as_json)


def _watched(plan: LampPlan, rig_path: Path) -> LampCalibration:
    require_calibration_date(plan.rig, rig_path)
    with OpenRig(plan.rig, white_mm=plan.tile_mm) as open_rig:
        open_rig.pose_scene(plan.theta_r_deg, plan.theta_i_deg)
        camera, lamp = open_rig.camera(), open_rig.lamp
        require_own_calibration(plan.rig, rig_path, camera)
        watcher = LampWatcher(
            plan=plan, camera=camera, lamp=lamp, operator=open_rig.operator, clock=open_rig.clock,
            say=_say,
        )  # fmt: skip
        return lamp_calibration_of(watcher.measure(), plan, lamp, camera, datetime.now(UTC))


def draw_board(path: Path | None, board: Board) -> None:
    """Write the PDF of a board to `path`, which must be new."""
    if path is None or path.suffix != ".pdf":
        raise InputError("gonio calibrate board: name the file to write: -o FILE.pdf")
    write_whole(path, board_pdf(board), new=True)
    width, height = board.size_mm
    print_lines(
        [
            f"{path}: {board}, {width:g} x {height:g} mm with its margin",
            "print it at 100 %, and check the ruler on it; the page says the rest",
        ]
    )


def calibrate_geometry(
    rig_path: Path | None,
    path: Path | None,
    options: Mapping[str, Any],
    *,
    plan_only: bool,
    yes: bool,
    as_json: bool,
) -> None:
    """Calibrate the geometry of a rig and write the file `path`; `plan_only`: only say how.

    `options` of `GeometryPlan`, by their names. `yes`: the rig may move, without asking.
    """
    rig = require_rig(rig_path)
    plan = GeometryPlan(rig=rig, **options)
    if plan_only:
        print_lines(plan.lines())
        return
    path = _require_path(path, "geometry")
    _require_somebody(rig, rig_path)
    with orderly_end():
        written = write_geometry_file(path, _seen(plan, yes))
    found = geometry_json(written, str(path))
    _print(written, found, geometry_lines(written, rig, path, out.width), path, as_json)


def _seen(plan: GeometryPlan, yes: bool) -> GeometryCalibration:
    rig = plan.rig
    with OpenRig(rig, board=plan.board) as open_rig:
        axes = {name: open_rig.axis(name) for name in AXES}
        camera = open_rig.camera()
        identity, stage = camera.identity(), axes["theta_r"].identity()
        what = "\n".join(plan.lines())
        confirm(rig, yes, f"{what}\nAll axes are homed first, and move through these poses.")
        positioner = Positioner(rig, axes, open_rig.lamp, open_rig.operator, _say)
        calibrator = GeometryCalibrator(
            plan=plan, camera=camera, lamp=open_rig.lamp, positioner=positioner,
            operator=open_rig.operator, say=_say,
        )  # fmt: skip
        with stopped_at_an_error(*axes.values()):
            positioner.home()
            corners = calibrator.measure()
        skipped, now = calibrator.skipped, datetime.now(UTC)
        return geometry_of(corners, plan, camera=identity, stage=stage, skipped=skipped, now=now)
