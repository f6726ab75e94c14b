"""Start document of a run: names of sample and rig, and the texts of its files."""

from __future__ import annotations

from collections.abc import Mapping

from instrument.config.load import Loaded

READINGS, TABLE = "readings", "measurements"
"""Streams of events: readings as in the record, and the rows of measurements.csv."""
KEYS = (
    "protocol", "rig", "protocol_sha256", "rig_sha256", "program_version", "versions",
    "started_utc", "white_tile", "camera_calibration", "geometry_calibration",
)  # fmt: skip
"""Entries of a record about the whole run that its start document has, where they are known."""


def start_metadata(meta: Mapping[str, str], loaded: Loaded) -> dict[str, object]:
    """Return entries of the start document: names at the top, texts of files under `gonio`."""
    return {
        "plan_name": "gonio_scan",
        "protocol": loaded.protocol.name,
        "sample": loaded.protocol.sample.name,
        "rig": loaded.rig.name,
        "gonio": {key: meta[key] for key in KEYS if key in meta},
    }
