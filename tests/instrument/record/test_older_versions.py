"""Records of earlier schema versions open with the same contents and take further readings."""

from __future__ import annotations

from pathlib import Path

import pytest

from instrument.record.record import Record
from tests.support.storage.older_records import as_version
from tests.support.storage.sample_records import reading, small_record


def contents(record: Record) -> list[object]:
    return [
        record.readings(), record.checks(), record.previews(), record.devices(),
        record.settings(), record.darks(), list(record.events()), record.frame_files(),
    ]  # fmt: skip


@pytest.mark.parametrize("version", [3, 4, 5])
def test_an_older_record_holds_what_it_held_and_takes_more(tmp_path: Path, version: int) -> None:
    with small_record(tmp_path / "run") as record:
        before = contents(record)
    as_version(tmp_path / "run", version)
    more = reading(5, signal_dn=float("nan"), flags="saturated")
    with Record.open(tmp_path / "run") as record:
        assert record.meta("schema_version") == str(version)
        assert contents(record) == before
        record.add_reading(more)
    with Record.open(tmp_path / "run") as record:
        assert record.meta("schema_version") == str(version)
        assert repr(record.readings()[-1]) == repr(more)
