"""Input files of a run as its report shows them: hashes, and what its calibrations found."""

from __future__ import annotations

from collections.abc import Iterator

from analysis.report.style import format_value, short_number
from instrument.calibration.camera_calibration import CameraCalibration
from instrument.calibration.geometry_file import GeometryCalibration
from instrument.calibration.quantity import Quantity
from instrument.config.rig import Rig
from instrument.record.record import Record

Rows = tuple[tuple[str, str], ...]

_FILES = {
    "protocol": "protocol",
    "rig": "rig",
    "white_tile": "table of the white tile",
    "camera_calibration": "calibration of the camera",
    "geometry_calibration": "calibration of the geometry",
}


def file_rows(record: Record) -> Rows:
    """Return a row for each input file: the SHA-256 of its text, which the record keeps."""
    digests = {name: record.meta(f"{key}_sha256") for key, name in _FILES.items()}
    return tuple((name, f"SHA-256 {digest}") for name, digest in digests.items() if digest)


def calibration_rows(rig: Rig) -> Rows:
    """Return what each calibration of a rig is of, when it was made, and its quantities ± u."""
    found = (("camera", rig.camera.measured), ("geometry", rig.measured))
    return tuple(row for kind, one in found if one is not None for row in _rows(kind, one))


def _rows(kind: str, one: CameraCalibration | GeometryCalibration) -> Iterator[tuple[str, str]]:
    made = one.date_utc.replace("T", " ").removesuffix("+00:00")
    yield kind, f"{one.camera}, {made} UTC, by gonio {one.program}; SHA-256 {one.sha256}"
    for quantity in one.quantities.values():
        yield quantity.name, _value(quantity)


def _value(quantity: Quantity) -> str:
    if quantity.value is None:
        return "not determined"
    if quantity.u is None:
        return f"{short_number(quantity.value, 4)} {quantity.unit}".rstrip()
    return format_value(quantity.value, quantity.u, quantity.unit)
