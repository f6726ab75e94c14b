"""Calibration of a lamp, and its file: see `archive` for the form.

Its arrays: `readings`, one row for each reading of the window (`READING_COLUMNS`), and `cells`, one
for each cell of the picture of the tile (`CELL_COLUMNS`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from instrument.calibration.archive import Archive, own_header, without_format
from instrument.calibration.quantity import Quantity
from instrument.errors import InputError
from instrument.geometry import FloatArray

READING_COLUMNS = ("age_s", "signal_dn", "u_dn")
CELL_COLUMNS = ("x_mm", "y_mm", "light", "pixels")
_TABLES = {"readings": len(READING_COLUMNS), "cells": len(CELL_COLUMNS)}
_ARCHIVE = Archive("lamp", 1)
is_lamp_file = _ARCHIVE.wrote
"""True for a path of such a file, which may be damaged all the same."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LightMap:
    """Light over the sample: sum of c * (x / half_mm)^i * (y / half_mm)^j, 1 at the axis.

    exponents: pairs i, j. coefficients: one for each pair. half_mm: half of the side of the square
    that was measured.
    """

    exponents: tuple[tuple[int, int], ...]
    coefficients: tuple[float, ...]
    half_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LampCalibration:
    """Drift, flicker and uniformity of one lamp at one date.

    lamp, camera: identities as the devices give them. settings: of the camera. pose_deg: theta_i,
    dphi and theta_r at which it was measured, in degrees. date_utc: in ISO 8601. steady: True if
    the light was steady at the end. quantities: by their key. arrays: `readings` and `cells`.
    sha256: of all the rest, empty before it is written.
    """

    lamp: str
    camera: str
    settings: dict[str, str]
    rig: str
    pose_deg: dict[str, float]
    date_utc: str
    program: str
    steady: bool
    quantities: dict[str, Quantity]
    light_map: LightMap
    notes: tuple[str, ...]
    arrays: dict[str, FloatArray]
    sha256: str = ""


def write_lamp_file(path: Path, calibration: LampCalibration) -> LampCalibration:
    """Write a calibration, whole or not at all, and return it with its hash."""
    arrays = dict(sorted(calibration.arrays.items()))
    digest = _ARCHIVE.write(path, own_header(calibration), arrays)
    return replace(calibration, sha256=digest)


def read_lamp_file(path: Path) -> LampCalibration:
    """Read a calibration; raise `InputError` if it is none, damaged, or of another version."""
    header, arrays, digest = _ARCHIVE.read(path)
    try:
        return _calibration(without_format(header), arrays, digest)
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"{path}: lacks what a calibration needs ({error}). Calibrate again"
        ) from error


def _calibration(own: dict[str, Any], arrays: dict[str, Any], digest: str) -> LampCalibration:
    for name, columns in _TABLES.items():
        if np.ndim(arrays[name]) != 2 or arrays[name].shape[1] != columns:
            raise ValueError(f"the table {name} has not {columns} columns")
    light = own["light_map"]
    return LampCalibration(
        **{
            **own,
            "quantities": {key: Quantity(**value) for key, value in own["quantities"].items()},
            "light_map": LightMap(
                exponents=tuple((int(i), int(j)) for i, j in light["exponents"]),
                coefficients=tuple(map(float, light["coefficients"])),
                half_mm=float(light["half_mm"]),
            ),
            "notes": tuple(own["notes"]),
            "arrays": arrays,
            "sha256": digest,
        }
    )
