"""Records of earlier schema versions open with the same contents and take further readings."""

from __future__ import annotations

from pathlib import Path

from instrument.record.record import Record
from tests.support.storage.older_records import as_version_3
from tests.support.storage.sample_records import reading, small_record


def contents(record: Record) -> list[object]:
    return [
        record.readings(), record.checks(), record.previews(), record.devices(),
        record.settings(), record.darks(), list(record.events()), record.frame_files(),
    ]  # fmt: skip


def test_a_record_of_version_3_holds_what_it_held_and_takes_more(tmp_path: Path) -> None:
    with small_record(tmp_path / "run") as record:
        before = contents(record)
    as_version_3(tmp_path / "run")
    more = reading(5, signal_dn=float("nan"), flags="saturated")
    with Record.open(tmp_path / "run") as record:
        assert record.meta("schema_version") == "3"
        assert contents(record) == before
        record.add_reading(more)
    with Record.open(tmp_path / "run") as record:
        assert record.meta("schema_version") == "3"
        assert repr(record.readings()[-1]) == repr(more)
