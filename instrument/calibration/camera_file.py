"""File of a camera's calibration: a ZIP archive of `calibration.json` and arrays of NumPy.

Any program reads it: `numpy.load` the arrays, `unzip -p FILE calibration.json` the rest.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import zipfile
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from instrument.calibration.camera_calibration import (
    LEVEL_COLUMNS,
    MAPS,
    CameraCalibration,
    Quantity,
)
from instrument.calibration.response_curve import ResponseCurve
from instrument.errors import InputError
from instrument.geometry import FloatArray
from instrument.text.atomic_file import read_file, write_whole

SUFFIX = ".npz"
_FORMAT, _VERSION = "gonio camera calibration", 1
_HEADER = "calibration.json"
_MOST_BYTES = 2 * 10**9  # of a file and of what it unpacks to: sensors of 50 million pixels
_DATE = (1980, 1, 1, 0, 0, 0)  # of members, the earliest of ZIP: equal contents are equal files


def write_camera_file(path: Path, calibration: CameraCalibration) -> CameraCalibration:
    """Write a calibration, whole or not at all, and return it with its hash."""
    header, arrays = _header(calibration), _packed(calibration.arrays)
    digest = _digest(header, arrays)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        text = json.dumps({**header, "sha256": digest}, indent=1, ensure_ascii=False)
        archive.writestr(zipfile.ZipInfo(_HEADER, _DATE), text + "\n")
        for name, array in arrays.items():
            with archive.open(zipfile.ZipInfo(f"{name}.npy", _DATE), "w") as member:
                np.lib.format.write_array(member, array, allow_pickle=False)
    write_whole(path, buffer.getvalue())
    return replace(calibration, sha256=digest)


def read_camera_file(path: Path) -> CameraCalibration:
    """Read a calibration; raise `InputError` if it is none, damaged, or of another version."""
    raw = _bytes_of(path)
    try:
        header, arrays = _unpacked(raw)
    except (zipfile.BadZipFile, KeyError, ValueError, EOFError, OSError) as error:
        raise InputError(
            f"{path}: is no camera calibration, or is damaged ({error}); allowed: a file that "
            "gonio calibrate camera wrote"
        ) from error
    if header.get("format") != _FORMAT or header.get("version") != _VERSION:
        raise InputError(
            f"{path}: is {header.get('format')!r}, version {header.get('version')!r}; allowed: "
            f"{_FORMAT!r}, version {_VERSION}. Calibrate again"
        )
    digest = header.pop("sha256", None)
    if digest != _digest(header, arrays):
        raise InputError(f"{path}: was changed or damaged since it was written. Calibrate again")
    _require_arrays(path, arrays)
    return replace(_calibration(path, header, digest), arrays=arrays)


def header_text(calibration: CameraCalibration) -> str:
    """Return all but the arrays as the text that a run keeps: see `read_camera_header`."""
    header = {**_header(calibration), "sha256": calibration.sha256}
    return json.dumps(header, indent=1, ensure_ascii=False) + "\n"


def read_camera_header(path: Path) -> CameraCalibration:
    """Read the copy that a run keeps of a calibration, without arrays; raise `InputError`.

    Who wrote it, the run, proves it by a hash of its own.
    """
    try:
        header = json.loads(_bytes_of(path))
        digest = header.pop("sha256")
    except (ValueError, KeyError, AttributeError, TypeError) as error:
        raise InputError(f"{path}: is no copy of a camera calibration ({error})") from error
    return _calibration(path, header, digest)


def _bytes_of(path: Path) -> bytes:
    try:
        return read_file(path, _MOST_BYTES)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read ({reason}): check its name") from error


def _header(calibration: CameraCalibration) -> dict[str, Any]:
    own = {**asdict(replace(calibration, arrays={})), "format": _FORMAT, "version": _VERSION}
    del own["arrays"], own["sha256"]
    return {**own, "notes": list(calibration.notes)}


def _packed(arrays: dict[str, FloatArray]) -> dict[str, Any]:
    """Return arrays as they are stored: maps in single precision, masks as such."""
    return {
        name: values.astype(np.float32) if name in MAPS and values.dtype != np.bool_ else values
        for name, values in sorted(arrays.items())
    }


def _digest(header: dict[str, Any], arrays: dict[str, Any]) -> str:
    """Return the SHA-256 of all that is stored."""
    whole = hashlib.sha256(json.dumps(header, sort_keys=True).encode())
    for name, array in sorted(arrays.items()):
        whole.update(f"{name} {array.dtype.str} {array.shape}".encode())
        whole.update(np.ascontiguousarray(array).tobytes())
    return whole.hexdigest()


def _unpacked(raw: bytes) -> tuple[dict[str, Any], dict[str, Any]]:
    with zipfile.ZipFile(io.BytesIO(raw)) as archive:
        if sum(info.file_size for info in archive.infolist()) > _MOST_BYTES:
            raise ValueError("larger than any calibration")
        header = json.loads(archive.read(_HEADER))
        if not isinstance(header, dict):
            raise ValueError(f"{_HEADER} is no table")
        arrays = {}
        for name in archive.namelist():
            if name.endswith(".npy"):
                member = io.BytesIO(archive.read(name))
                arrays[name.removesuffix(".npy")] = np.lib.format.read_array(
                    member, allow_pickle=False
                )
    return header, arrays


def _calibration(path: Path, header: dict[str, Any], digest: str) -> CameraCalibration:
    """Return the calibration that a file holds, without arrays; its hash was found right."""
    try:
        curve = header["curve"]
        quantities = {key: Quantity(**own) for key, own in header["quantities"].items()}
        own = {k: v for k, v in header.items() if k not in ("format", "version")}
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
