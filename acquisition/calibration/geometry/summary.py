"""Summary of a geometry's calibration: a table for a person, and JSON."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from acquisition.calibration.geometry.result import stated_by_rig
from acquisition.calibration.summary import quantities_json, quantity_lines
from acquisition.terminal.layout import wrapped
from instrument.calibration.geometry_file import GeometryCalibration
from instrument.config.rig import Rig


def geometry_lines(
    calibration: GeometryCalibration, rig: Rig, path: Path, width: int
) -> Iterator[str]:
    """Yield the lines of the summary for a terminal of this width."""
    title = f"geometry of {calibration.rig} with {calibration.camera}, {calibration.date_utc}"
    yield from wrapped(title, width)
    yield from quantity_lines(calibration.quantities, stated_by_rig(rig), width)
    yield ""
    yield from wrapped(
        f"name it in the rig file: geometry: {path.name}; it then replaces field_width_mm, "
        "axis_row_px, axis_column_px and roll_deg of the camera, and zero_deg of theta_r "
        f"({calibration.zero_deg:.4f})",
        width,
    )


def geometry_json(calibration: GeometryCalibration, file: str) -> dict[str, object]:
    """Return the calibration as JSON takes it, without its table of corners."""
    return {
        "file": file,
        "sha256": calibration.sha256,
        "camera": calibration.camera,
        "stage": calibration.stage,
        "rig": calibration.rig,
        "board": calibration.board,
        "date_utc": calibration.date_utc,
        **calibration.camera_values(),
        "zero_deg": calibration.zero_deg,
        "quantities": quantities_json(calibration.quantities),
        "notes": list(calibration.notes),
    }
