"""Archive of a calibration: a ZIP file of `calibration.json` and arrays of NumPy, with its hash.

Any program reads it: `numpy.load` the arrays, `unzip -p FILE calibration.json` the rest.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from instrument.errors import InputError
from instrument.text.atomic_file import read_file, write_whole

SUFFIX = ".npz"
_HEADER = "calibration.json"
_MOST_BYTES = 2 * 10**9  # of a file and of what it unpacks to: sensors of 50 million pixels
_DATE = (1980, 1, 1, 0, 0, 0)  # of members, the earliest of ZIP: equal contents are equal files

Arrays = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Archive:
    """Kind of calibration: its name in files and messages, and the version of its format."""

    kind: str
    version: int

    @property
    def format(self) -> str:
        """Name of the format in a file."""
        return f"gonio {self.kind} calibration"

    def header(self, own: dict[str, Any]) -> dict[str, Any]:
        """Return a header with format and version."""
        return {**own, "format": self.format, "version": self.version}

    def write(self, path: Path, own: dict[str, Any], arrays: Arrays) -> str:
        """Write a file, whole or not at all, and return its hash."""
        header = self.header(own)
        digest = _digest(header, arrays)
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
            text = json.dumps({**header, "sha256": digest}, indent=1, ensure_ascii=False)
            archive.writestr(zipfile.ZipInfo(_HEADER, _DATE), text + "\n")
            for name, array in arrays.items():
                with archive.open(zipfile.ZipInfo(f"{name}.npy", _DATE), "w") as member:
                    np.lib.format.write_array(member, array, allow_pickle=False)
        write_whole(path, buffer.getvalue())
        return digest

    def wrote(self, path: Path) -> bool:
        """Return True if a file says that it is of this kind; it may be damaged all the same."""
        try:
            with zipfile.ZipFile(path) as archive:
                header = json.loads(archive.read(_HEADER))
        except (zipfile.BadZipFile, KeyError, ValueError, EOFError, OSError):
            return False
        return isinstance(header, dict) and header.get("format") == self.format

    def read(self, path: Path) -> tuple[dict[str, Any], Arrays, str]:
        """Return header, arrays and hash of a file.

        Raises `InputError` if it is none of this kind, is damaged, or has another version.
        """
        raw = bytes_of(path)
        try:
            header, arrays = _unpacked(raw)
        except (zipfile.BadZipFile, KeyError, ValueError, EOFError, OSError) as error:
            raise InputError(
                f"{path}: is no {self.kind} calibration, or is damaged ({error}); allowed: a file "
                f"that gonio calibrate {self.kind} wrote"
            ) from error
        if header.get("format") != self.format or header.get("version") != self.version:
            raise InputError(
                f"{path}: is {header.get('format')!r}, version {header.get('version')!r}; allowed: "
                f"{self.format!r}, version {self.version}. Calibrate again"
            )
        digest = header.pop("sha256", None)
        if digest != _digest(header, arrays):
            raise InputError(
                f"{path}: was changed or damaged since it was written. Calibrate again"
            )
        return header, arrays, digest

    def copy_text(self, calibration: Any) -> str:
        """Return all of a calibration but its arrays as the text that a run keeps: `read_copy`."""
        header = {**self.header(own_header(calibration)), "sha256": calibration.sha256}
        return json.dumps(header, indent=1, ensure_ascii=False) + "\n"

    def read_copy(self, path: Path) -> tuple[dict[str, Any], str]:
        """Return header and hash from the copy that a run keeps; raise `InputError`.

        Who wrote it, the run, proves it by a hash of its own.
        """
        try:
            header = json.loads(bytes_of(path))
            return header, header.pop("sha256")
        except (ValueError, KeyError, AttributeError, TypeError) as error:
            raise InputError(
                f"{path}: is no copy of a {self.kind} calibration ({error})"
            ) from error


def own_header(calibration: Any) -> dict[str, Any]:
    """Return all of a calibration, a dataclass, but its arrays and hash."""
    own = asdict(replace(calibration, arrays={}))
    del own["arrays"], own["sha256"]
    return own


def without_format(header: dict[str, Any]) -> dict[str, Any]:
    """Return what `Archive.header` was given."""
    return {k: v for k, v in header.items() if k not in ("format", "version")}


def bytes_of(path: Path) -> bytes:
    """Return a file's content; raise `InputError` if it cannot be read."""
    try:
        return read_file(path, _MOST_BYTES)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read ({reason}): check its name") from error


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
