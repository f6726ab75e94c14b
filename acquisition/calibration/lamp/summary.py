"""Summary of a lamp's calibration: a table for a person, and JSON."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict

from acquisition.calibration.lamp.result import stated_by_rig
from acquisition.calibration.summary import quantities_json, quantity_lines
from acquisition.terminal.console import duration_text
from acquisition.terminal.layout import wrapped
from instrument.calibration.lamp_file import LampCalibration
from instrument.config.rig import Rig


def lamp_lines(calibration: LampCalibration, rig: Rig, width: int) -> Iterator[str]:
    """Yield the lines of the summary for a terminal of this width."""
    yield from wrapped(f"calibration of {calibration.lamp}, {calibration.date_utc}", width)
    yield from quantity_lines(calibration.quantities, stated_by_rig(rig), width)
    yield ""
    yield from wrapped(steady_text(calibration), width)


def steady_text(calibration: LampCalibration) -> str:
    """Return in words whether the lamp is steady."""
    if not calibration.steady:
        return "the lamp is NOT steady"
    seconds = calibration.quantities["steady_s"].value or 0.0
    when = f"{duration_text(seconds)} after" if seconds >= 1 else "from"
    return f"the lamp is steady, {when} the start of the watch"


def lamp_json(calibration: LampCalibration, file: str) -> dict[str, object]:
    """Return the calibration as JSON takes it, without its tables."""
    return {
        "file": file,
        "sha256": calibration.sha256,
        "lamp": calibration.lamp,
        "camera": calibration.camera,
        "settings": calibration.settings,
        "rig": calibration.rig,
        "pose_deg": calibration.pose_deg,
        "date_utc": calibration.date_utc,
        "steady": calibration.steady,
        "quantities": quantities_json(calibration.quantities),
        "light_map": asdict(calibration.light_map),
        "notes": list(calibration.notes),
    }
