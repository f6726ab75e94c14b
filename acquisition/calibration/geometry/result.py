"""Evaluation of a board's corners: the geometry of the rig, with u, and what a person should know.

A wrong square would scale all lengths, and only the length of the beam, which the rig file states,
tells it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from datetime import datetime

import numpy as np

from acquisition.calibration.geometry.plan import GeometryPlan
from acquisition.calibration.result import quantity
from acquisition.results.versions import versions_of
from analysis.calibration.geometry.corners import Corners
from analysis.calibration.geometry.geometry_fit import GeometryFit, fit_geometry
from analysis.calibration.level_series import Estimate
from instrument.calibration.geometry_file import DISTORTION, ZERO, GeometryCalibration
from instrument.calibration.quantity import Quantity
from instrument.config.rig import Rig
from instrument.errors import NotDetermined
from instrument.pinhole import Pinhole

_MOST_RMS_PX = 1.5  # of the corners: more is another board, or one that is far from flat
_USUAL_RMS_PX = 0.3  # a sheet that is 0.05 mm off flat, seen at 60 degrees with 9 px per mm
_BEAM_PERCENT = 5.0  # a tape measure is better; a board of another size is worse
_NOTABLE = 3.0  # times u
_WANDERS = 1.5  # times the axis's u_deg
_NARROW_PX = 25.0  # of a square: with fewer, corners are biased by what is next to them
_FEW = 0.95  # share of the corners that lie where the others let expect them
THETA_I_TEXT = (
    "the zero of theta_i is not determined: a camera sees the lamp's angle only by a mirror-like "
    "patch, and the board has none. Its u belongs into u_deg of that axis"
)


def geometry_of(
    corners: Corners,
    plan: GeometryPlan,
    *,
    camera: str,
    stage: str,
    skipped: list[str],
    now: datetime,
) -> GeometryCalibration:
    """Return the calibration. Raises `NotDetermined` if the corners contradict the board."""
    rig = plan.rig
    fit = fit_geometry(corners, Pinhole.of(rig), rig.axes.theta_r.u_deg)
    _require_board(fit, plan)
    zero, axis, lens = fit.values["zero_deg"], rig.axes.theta_r, fit.lens
    return GeometryCalibration(
        camera=camera,
        stage=stage,
        size_px=(rig.camera.width_px, rig.camera.height_px),
        rig=rig.name,
        board=str(plan.board),
        date_utc=now.isoformat(timespec="seconds"),
        program=f"gonio {versions_of('gonio')['gonio']}",
        field_width_mm=lens.field_width_mm,
        axis_row_px=lens.axis_row_px,
        axis_column_px=lens.axis_column_px,
        roll_deg=lens.roll_deg,
        zero_deg=axis.zero_deg - axis.sign * zero.value,
        sign=axis.sign,
        quantities=dict(_quantities(fit, plan)),
        notes=(*_notes(fit, plan), *skipped),
        arrays={"corners": _table(corners, fit)},
    )


def _require_board(fit: GeometryFit, plan: GeometryPlan) -> None:
    """Raise `NotDetermined` if the corners are not those of the board."""
    if fit.rms_px > _MOST_RMS_PX:
        raise NotDetermined(
            f"board: its corners lie {fit.rms_px:.2g} px (rms) from those of {plan.board}; "
            f"allowed: {_MOST_RMS_PX:g}. Compare --columns and --rows with the board, and look "
            "whether it is flat and was not moved"
        )
    beam = fit.values["beam_percent"]
    if abs(beam.value) > max(_BEAM_PERCENT, _NOTABLE * beam.u):
        length = fit.lens.beam_length_mm
        raise NotDetermined(
            f"board: with squares of {plan.board.square_mm:g} mm the camera would be {length:.0f} "
            f"mm from the axis, u {beam.u * length / 100:.2g} mm; the rig file says "
            f"beam_length_mm {plan.rig.beam_length_mm:g}. Measure the squares (--square-mm: "
            f"{plan.board.square_mm * plan.rig.beam_length_mm / length:.3g} would fit), or the beam"
        )


def _quantities(fit: GeometryFit, plan: GeometryPlan) -> Iterator[tuple[str, Quantity]]:
    """Yield each quantity with its key, in the order of the table."""
    lens, values, spread = fit.lens, fit.values, fit.spread
    picture_px = float(np.hypot(spread["columns"], spread["rows"]))
    scale = plan.u_square_mm / plan.board.square_mm
    for key, value, fitted, name in (
        (
            "field_width_mm",
            lens.field_width_mm,
            "field_percent",
            "width of the picture at the axis",
        ),
        ("beam_length_mm", lens.beam_length_mm, "beam_percent", "lens to the axis"),
    ):
        u = value * float(np.hypot(values[fitted].u / 100, scale))
        yield key, quantity(Estimate(value, u), "mm", "", name)
    per_mm = lens.width_px / lens.field_width_mm
    u = per_mm * float(np.hypot(values["field_percent"].u / 100, scale))
    yield "px_per_mm", quantity(Estimate(per_mm, u), "px/mm", "", "scale at the axis")
    for key, unit, name in (
        ("axis_column_px", "px", "column of the axis"),
        ("axis_row_px", "px", "row of the table's middle"),
        ("roll_deg", "deg", "roll of the camera"),
        (DISTORTION, "%", "distortion at half the diagonal"),
    ):
        yield key, quantity(values[key], unit, "", name)
    zero = quantity(values["zero_deg"], "deg", "", "zero of theta_r: true minus shown")
    yield ZERO, zero
    yield "theta_i_zero_error_deg", quantity(None, "deg", "", "zero of theta_i")
    for key, unit, name in (
        ("table_lean_deg", "deg", "lean of the table, across"),
        ("height_mm", "mm", "height of the board above the axis"),
        ("lean_deg", "deg", "lean of the board on the table"),
        ("lean_across_deg", "deg", "... across the camera's plane"),
    ):
        yield key, quantity(values[key], unit, "", name)
    for key, value, unit, name in (
        ("axis_scatter_deg", spread["axis"], "deg", "scatter of theta_r"),
        ("picture_scatter_px", picture_px, "px", "scatter of the picture's place"),
        ("print_scatter_mm", spread["print"], "mm", "scatter of the printed corners"),
        ("rms_px", fit.rms_px, "px", "corners left over, rms"),
    ):
        yield key, Quantity(value=value, u=None, unit=unit, symbol="", name=name)


def stated_by_rig(rig: Rig) -> dict[str, float]:
    """Return what the rig file states, by the key of the quantity."""
    camera = rig.camera
    return {
        "field_width_mm": camera.field_width_mm,
        "beam_length_mm": rig.beam_length_mm,
        "px_per_mm": camera.width_px / camera.field_width_mm,
        "axis_column_px": camera.axis_column_px,
        "axis_row_px": camera.axis_row_px,
        "roll_deg": camera.roll_deg,
        "axis_scatter_deg": rig.axes.theta_r.u_deg,
    }


def _notes(fit: GeometryFit, plan: GeometryPlan) -> Iterator[str]:
    """Yield findings that a person should act on."""
    yield THETA_I_TEXT
    beam, rig = fit.values["beam_percent"], plan.rig
    if abs(beam.value) > max(_NOTABLE * beam.u, 100 * plan.u_square_mm / plan.board.square_mm, 1):
        yield (
            f"beam_length_mm {rig.beam_length_mm:g} of the rig file does not fit: "
            f"{fit.lens.beam_length_mm:.4g} mm does (entrance pupil of the lens to the axis)"
        )
    scatter_deg = fit.spread["axis"]
    per_mm = fit.lens.width_px / fit.lens.field_width_mm
    narrow_px = per_mm * plan.board.square_mm * math.cos(math.radians(plan.widest_deg))
    if narrow_px < _NARROW_PX:
        yield (
            f"squares are {narrow_px:.0f} px wide at {plan.widest_deg:g} deg; from {_NARROW_PX:g} "
            "px on their corners are found without bias, which shows here as a scatter of theta_r "
            "and a wrong beam: take fewer, larger squares, or a smaller --widest-deg"
        )
    if scatter_deg > _WANDERS * rig.axes.theta_r.u_deg:
        yield (
            f"theta_r errs by {scatter_deg:.2g} deg from angle to angle; the rig file's u_deg is "
            f"{rig.axes.theta_r.u_deg:g}: enlarge it, or look at the stage"
        )
    if fit.rms_px > _USUAL_RMS_PX:
        yield (
            f"the corners lie {fit.rms_px:.2g} px (rms) from a flat board; usual: below "
            f"{_USUAL_RMS_PX:g}. Is the sheet flat, and the picture in focus? The u are enlarged"
        )
    if np.mean(fit.used) < _FEW:
        gone = int(np.count_nonzero(~fit.used))
        yield f"{gone} of {fit.used.size} corners lie far from where the others expect them"


def _table(corners: Corners, fit: GeometryFit) -> np.ndarray:
    """Return the used corners as rows of `CORNER_COLUMNS`."""
    own = corners.only(fit.used)
    shown, turned = corners.theta_r_deg[own.picture], corners.turned[own.picture]
    return np.column_stack([shown, turned, own.board_mm[own.number], own.pixels, fit.residuals_px])
