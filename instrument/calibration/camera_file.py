"""File of a camera's calibration: see `archive` for its form."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from instrument.calibration.archive import Archive, own_header, without_format
from instrument.calibration.camera_calibration import LEVEL_COLUMNS, MAPS, CameraCalibration
from instrument.calibration.quantity import Quantity
from instrument.calibration.response_curve import ResponseCurve
from instrument.errors import InputError
from instrument.geometry import FloatArray

_ARCHIVE = Archive("camera", 1)
is_camera_file = _ARCHIVE.wrote
"""True for a path of such a file, which may be damaged all the same."""


def write_camera_file(path: Path, calibration: CameraCalibration) -> CameraCalibration:
    """Write a calibration, whole or not at all, and return it with its hash."""
    digest = _ARCHIVE.write(path, own_header(calibration), _packed(calibration.arrays))
    return replace(calibration, sha256=digest)


def read_camera_file(path: Path) -> CameraCalibration:
    """Read a calibration; raise `InputError` if it is none, damaged, or of another version."""
    header, arrays, digest = _ARCHIVE.read(path)
    _require_arrays(path, arrays)
    return replace(_calibration(path, header, digest), arrays=arrays)


def header_text(calibration: CameraCalibration) -> str:
    """Return all but the arrays as the text that a run keeps: see `read_camera_header`."""
    return _ARCHIVE.copy_text(calibration)


def read_camera_header(path: Path) -> CameraCalibration:
    """Read the copy that a run keeps of a calibration, without arrays; raise `InputError`."""
    return _calibration(path, *_ARCHIVE.read_copy(path))


def _packed(arrays: dict[str, FloatArray]) -> dict[str, Any]:
    """Return arrays as they are stored: maps in single precision, masks as such."""
    return {
        name: values.astype(np.float32) if name in MAPS and values.dtype != np.bool_ else values
        for name, values in sorted(arrays.items())
    }


def _calibration(path: Path, header: dict[str, Any], digest: str) -> CameraCalibration:
    """Return the calibration that a file holds, without arrays; its hash was found right."""
    try:
        curve = header["curve"]
        quantities = {key: Quantity(**own) for key, own in header["quantities"].items()}
        own = without_format(header)
        own.update(
            curve=ResponseCurve(curve["kind"], tuple(map(float, curve["parameters"]))),
            quantities=quantities, notes=tuple(header["notes"]), arrays={}, sha256=digest,
        )  # fmt: skip
        found = CameraCalibration(**own)
        ends = found.linear_counts_dn(np.array([found.black_dn, found.max_dn]))
        if not all(map(math.isfinite, ends.tolist())):
            raise ValueError("its response curve has no values")
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"{path}: lacks what a calibration needs ({error}). Calibrate again"
        ) from error
    return found


def _require_arrays(path: Path, arrays: dict[str, Any]) -> None:
    """Raise `InputError` if a map is missing or of another shape than the others."""
    wanted = {*MAPS, "lit", "dark"}
    shapes = {name: array.shape for name, array in arrays.items()}
    maps = {shapes.get(name) for name in MAPS}
    tables = {shapes.get(name, ())[1:] for name in ("lit", "dark")}
    if not wanted <= set(shapes) or len(maps) != 1 or tables != {(len(LEVEL_COLUMNS),)}:
        raise InputError(
            f"{path}: lacks what a calibration needs: its arrays have the shapes {shapes}. "
            "Calibrate again"
        )
