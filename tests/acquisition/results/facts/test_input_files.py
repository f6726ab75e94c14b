"""Input files in a report: every hash of the record, every quantity of a calibration."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

from acquisition.results.facts.input_files import calibration_rows, file_rows
from instrument.calibration.quantity import Quantity
from instrument.config.rig import Rig
from instrument.record.record import Record


def test_each_hash_of_the_record_has_a_row() -> None:
    meta = {"protocol_sha256": "ab" * 32, "camera_calibration_sha256": "cd" * 32, "rig": "text"}
    rows = file_rows(cast(Record, SimpleNamespace(meta=meta.get)))
    assert rows == (
        ("protocol", f"SHA-256 {'ab' * 32}"),
        ("calibration of the camera", f"SHA-256 {'cd' * 32}"),
    )


def test_a_calibration_says_whose_and_when_and_what_it_found() -> None:
    gain = Quantity(value=0.25, u=0.0021, unit="DN/e-", symbol="K", name="gain")
    none = Quantity(value=None, u=None, unit="", symbol="x", name="hot pixels")
    one = SimpleNamespace(
        camera="serial 7", date_utc="2026-03-01T10:00:00+00:00", program="0.2.0", sha256="ef",
        quantities={"gain": gain, "hot": none},
    )  # fmt: skip
    rig = SimpleNamespace(camera=SimpleNamespace(measured=one), measured=None)
    rows = calibration_rows(cast(Rig, rig))
    assert rows == (
        ("camera", "serial 7, 2026-03-01 10:00:00 UTC, by gonio 0.2.0; SHA-256 ef"),
        ("gain", "0.2500 ± 0.0021\u00a0DN/e-"),
        ("hot pixels", "not determined"),
    )
