"""Calibration of a rig's geometry, and its file: see `archive` for the form.

Its array `corners` has one row for each corner of the board in each picture (`CORNER_COLUMNS`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from instrument.calibration.archive import Archive, own_header, without_format
from instrument.calibration.quantity import Quantity
from instrument.calibration.same_device import require_recent, require_same_camera
from instrument.errors import InputError
from instrument.geometry import FloatArray

CORNER_COLUMNS = (
    "theta_r_deg", "turned", "x_mm", "y_mm", "column_px", "row_px", "residual_column_px",
    "residual_row_px",
)  # fmt: skip
CAMERA_KEYS = ("field_width_mm", "axis_row_px", "axis_column_px", "roll_deg")
"""Keys of a rig file's camera that such a calibration gives."""
ZERO = "theta_r_zero_error_deg"
"""Key of the quantity that tells how far the zero was off."""
DISTORTION = "distortion_percent"
"""Key of the quantity that tells the lens's distortion."""
_ARCHIVE = Archive("geometry", 1)
is_geometry_file = _ARCHIVE.wrote
"""True for a path of such a file, which may be damaged all the same."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GeometryCalibration:
    """Geometry of one rig at one date.

    camera, stage: identities of the camera and of the axis theta_r as the devices give them.
    size_px: width and height of the picture. board: in words. date_utc: in ISO 8601.
    field_width_mm, axis_row_px, axis_column_px, roll_deg: as the keys of a rig file's camera.
    zero_deg, sign: of the axis theta_r, as the keys of a rig file: its device reads zero_deg when
    the camera looks along the normal of the table. quantities: by their key. arrays: `corners`.
    sha256: of all the rest, empty before it is written.
    """

    camera: str
    stage: str
    size_px: tuple[int, int]
    rig: str
    board: str
    date_utc: str
    program: str
    field_width_mm: float
    axis_row_px: float
    axis_column_px: float
    roll_deg: float
    zero_deg: float
    sign: int
    quantities: dict[str, Quantity]
    notes: tuple[str, ...]
    arrays: dict[str, FloatArray]
    sha256: str = ""

    def camera_values(self) -> dict[str, float]:
        """Return the values of `CAMERA_KEYS`."""
        return {key: getattr(self, key) for key in CAMERA_KEYS}

    @property
    def distortion(self) -> float:
        """Relative displacement at half the picture's diagonal; 0 where it was not found."""
        found = self.quantities.get(DISTORTION)
        return 0.0 if found is None or found.value is None else found.value / 100

    @property
    def u_zero_deg(self) -> float:
        """Standard uncertainty of the zero of theta_r, in degrees."""
        return self.quantities[ZERO].u or 0.0

    def require_camera(self, name: str, camera: str) -> None:
        """Raise `InputError` if the file `name` is of another camera."""
        require_same_camera(name, "geometry", self.camera, camera)

    def require_date(self, name: str, now: datetime) -> None:
        """Raise `InputError` if the calibration in the file `name` is too old, or of the future."""
        require_recent(name, self.date_utc, now)


def write_geometry_file(path: Path, calibration: GeometryCalibration) -> GeometryCalibration:
    """Write a calibration, whole or not at all, and return it with its hash."""
    digest = _ARCHIVE.write(path, own_header(calibration), calibration.arrays)
    return replace(calibration, sha256=digest)


def read_geometry_file(path: Path) -> GeometryCalibration:
    """Read a calibration; raise `InputError` if it is none, damaged, or of another version."""
    header, arrays, digest = _ARCHIVE.read(path)
    found = _calibration(path, header, digest)
    shape = np.asarray(arrays.get("corners")).shape
    if len(shape) != 2 or shape[1] != len(CORNER_COLUMNS):
        raise _lacking(path, "its corners")
    return replace(found, arrays=arrays)


def geometry_text(calibration: GeometryCalibration) -> str:
    """Return all but the arrays as the text that a run keeps: see `read_geometry_text`."""
    return _ARCHIVE.copy_text(calibration)


def read_geometry_text(path: Path) -> GeometryCalibration:
    """Read the copy that a run keeps of a calibration, without arrays; raise `InputError`."""
    return _calibration(path, *_ARCHIVE.read_copy(path))


def _calibration(path: Path, header: dict[str, Any], digest: str) -> GeometryCalibration:
    """Return the calibration that a file holds, without arrays; its hash was found right."""
    try:
        own = without_format(header)
        own.update(
            size_px=(int(own["size_px"][0]), int(own["size_px"][1])),
            quantities={key: Quantity(**value) for key, value in own["quantities"].items()},
            notes=tuple(own["notes"]), arrays={}, sha256=digest,
        )  # fmt: skip
        found = GeometryCalibration(**own)
        place = (*found.camera_values().values(), found.zero_deg, float(found.sign))
        numbers = (*place, found.u_zero_deg)
        if not all(map(math.isfinite, numbers)):
            raise ValueError("a value is not finite")
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise _lacking(path, str(error)) from error
    return found


def _lacking(path: Path, what: str) -> InputError:
    return InputError(f"{path}: lacks what a calibration needs ({what}). Calibrate again")
