"""Folder of a run: its name, its copies of its input files, and the data that identify the run.

They are the protocol, the rig, the table of the white tile if the protocol names one, and the
calibrations of camera and geometry, without maps and tables, if the rig names them. The record
keeps the texts and
their SHA-256. The copies are for people and for `load_run_inputs`, which refuses a copy that was
edited: readings before and after the edit would not belong together.
"""

from __future__ import annotations

import hashlib
import json
import platform
from datetime import UTC, datetime
from pathlib import Path

from acquisition.plan.plan import Plan
from acquisition.results.model_check import check_model
from acquisition.results.versions import LIBRARIES, versions_of
from instrument.config.load import Loaded, load_protocol
from instrument.errors import InputError, StorageError
from instrument.record.record import Record
from instrument.text.atomic_file import write_whole

PROTOCOL_FILE, RIG_FILE, TILE_FILE = "protocol.yaml", "rig.yaml", "white_tile.csv"
CALIBRATION_FILE = "camera_calibration.json"
GEOMETRY_FILE = "geometry_calibration.json"
# By the record's key of the text; the last three only where protocol and rig name them.
_FILES = {
    "protocol": PROTOCOL_FILE,
    "rig": RIG_FILE,
    "white_tile": TILE_FILE,
    "camera_calibration": CALIBRATION_FILE,
    "geometry_calibration": GEOMETRY_FILE,
}


def default_folder(loaded: Loaded) -> Path:
    """Return `runs/NAME-DATE-TIME`, with the protocol file's name and the time in UTC."""
    now = datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
    return Path("runs") / f"{loaded.protocol_path.stem}-{now}"


def run_meta(loaded: Loaded, plan: Plan) -> dict[str, str]:
    """Return what the record keeps of a new run: inputs, metadata, versions, start, length."""
    ran_on = {"python": platform.python_version(), "system": platform.platform()}
    return {
        "protocol_file": str(loaded.protocol_path),
        "rig_file": str(loaded.rig_path),
        "protocol": loaded.protocol_text,
        "rig": loaded.rig_text,
        "protocol_sha256": _digest(loaded.protocol_text),
        "rig_sha256": _digest(loaded.rig_text),
        "program_version": versions_of("gonio")["gonio"],
        "versions": json.dumps(ran_on | versions_of(*LIBRARIES)),
        "started_utc": datetime.now(UTC).isoformat(timespec="seconds"),
        "planned_s": f"{plan.duration_s:.1f}",
        "hidden": str(len(plan.hidden)),
        "steps": str(len(plan.steps)),
        **_text_meta("white_tile", loaded.tile_text),
        **_text_meta("camera_calibration", loaded.calibration_text),
        **_text_meta("geometry_calibration", loaded.geometry_text),
        **loaded.protocol.metadata.given(),
    }


def _text_meta(key: str, text: str | None) -> dict[str, str]:
    """Return the text of a file that not every run has, with its hash; nothing without one."""
    return {} if text is None else {key: text, f"{key}_sha256": _digest(text)}


def write_run_inputs(record: Record) -> None:
    """Write the run's copies of its input files where they are missing.

    A process that was killed early may have left a record without them. Raises `StorageError`.
    """
    for key, name in _FILES.items():
        text, path = record.meta(key), record.folder / name
        if text is None or path.exists():
            continue
        try:
            write_whole(path, text)
        except StorageError as error:
            raise StorageError(f"{error}, then: gonio resume {record.folder}") from error


def load_run_inputs(record: Record) -> Loaded:
    """Load the run's copies of its input files; raises `InputError` if one was changed."""
    folder = record.folder
    loaded = load_protocol(
        folder / PROTOCOL_FILE,
        folder / RIG_FILE,
        check_model=check_model,
        tile_path=folder / TILE_FILE,
        calibration_path=folder / CALIBRATION_FILE,
        geometry_path=folder / GEOMETRY_FILE,
    )
    texts = {
        "protocol": loaded.protocol_text,
        "rig": loaded.rig_text,
        "white_tile": loaded.tile_text,
        "camera_calibration": loaded.calibration_text,
        "geometry_calibration": loaded.geometry_text,
    }
    for key, name in _FILES.items():
        text = texts[key]
        if record.meta(f"{key}_sha256") != (None if text is None else _digest(text)):
            raise InputError(
                f"{folder / name}: changed since the run began, so its readings would not belong "
                "together: restore the file, or start a new run"
            )
    return loaded


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
