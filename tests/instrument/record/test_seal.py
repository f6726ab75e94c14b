"""Seals of rows: a value that changed on the disk is noticed, whichever bit of it changed."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from instrument.errors import InputError
from instrument.record.record import FILE_NAME, Record
from instrument.record.schema import TABLES
from instrument.record.seal import damaged_rows
from tests.support.storage.bit_flips import flips
from tests.support.storage.sample_records import reading, small_record

CONTENTS = (
    "readings", "checks", "previews", "devices", "settings", "darks", "events", "frame_files",
)  # fmt: skip


def contents(record: Record) -> dict[str, list[str]]:
    """Everything a record holds, each item as text."""
    found: dict[str, list[str]] = {}
    for name in CONTENTS:
        rows = getattr(record, name)()
        found[name] = [repr(row) for row in (rows.items() if isinstance(rows, dict) else rows)]
    found["meta"] = [repr((key, record.meta(key))) for key in ("steps", "hidden", "protocol")]
    return found


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A closed record with rows in each table, with whole numbers and NaN among its values."""
    with small_record(tmp_path / "run") as record:
        record.add_reading(reading(5, signal_dn=float("nan"), u_placement_dn=-0.0, peak_dn=2500))
    return tmp_path / "run"


def changed(run: Path, old: bytes, new: bytes) -> None:
    """Replace bytes that stand once in the file."""
    data = (run / FILE_NAME).read_bytes()
    assert data.count(old) == 1
    (run / FILE_NAME).write_bytes(data.replace(old, new))


def test_a_record_as_it_was_written_has_no_damage(run: Path) -> None:
    with Record.open(run) as record:
        assert record.damaged() == ()
        assert len(record.readings()) == 6


@pytest.mark.parametrize("table", TABLES)
def test_each_column_of_each_table_is_sealed(run: Path, table: str) -> None:
    """Except a number that SQLite assigns."""
    with closing(sqlite3.connect(run / FILE_NAME)) as database:
        database.execute("PRAGMA ignore_check_constraints = ON")
        for column in TABLES[table]:
            if column.name == "id":
                continue
            other = {"TEXT": "'x'", "BLOB": "x'00'"}.get(column.sql_type, "99")
            last = f"(SELECT MAX(rowid) FROM {table})"
            database.execute(f"UPDATE {table} SET {column.name} = {other} WHERE rowid = {last}")
            assert len(damaged_rows(database)[table]) == 1, column.name
            database.rollback()
            assert damaged_rows(database) == {}


def test_a_damaged_reading_is_named_left_out_and_can_be_measured_again(run: Path) -> None:
    """A value, a flag and a text that is no UTF-8 any more."""
    with closing(sqlite3.connect(run / FILE_NAME)) as database:
        database.execute("UPDATE reading SET signal_dn = 2000.75 WHERE step = 1")
        database.execute("UPDATE reading SET frames = 5 WHERE step = 3")
        database.execute("UPDATE event SET text = 'gone'")
        database.commit()
    with Record.open(run) as record:
        assert record.damaged() == ("event 1", "reading 1", "reading 3")
        assert [r.step for r in record.readings()] == [0, 2, 4, 5]
        record.remove_damaged()
        record.add_reading(reading(1), None, [], [])
        assert record.damaged() == ()
    with Record.open(run) as record:
        assert record.damaged() == ()
        assert [r.step for r in record.readings()] == [0, 1, 2, 4, 5]
        assert [p.step for p in record.previews()] == [0, 2, 4]
        assert record.frame_files() == ["frames/0.tiff", "frames/2.tiff", "frames/4.tiff"]


def test_damage_that_no_measurement_replaces_is_refused(run: Path) -> None:
    changed(run, "name: größer".encode(), "name: grösser".encode())
    with pytest.raises(InputError, match=r"meta, row \d: damaged since it was written"):
        Record.open(run)


@pytest.mark.slow
def test_a_flipped_bit_never_changes_a_value_in_silence(run: Path, slow: bool) -> None:
    """Refused by name, or all that is returned is as written, and what is missing is named."""
    with Record.open(run) as record:
        whole = contents(record)
    path, left_out, refused = run / FILE_NAME, 0, list[str]()
    for spoilt, _ in zip(flips(path.read_bytes(), 16), range(4000 if slow else 150), strict=False):
        for end in ("-wal", "-shm"):
            (run / f"{FILE_NAME}{end}").unlink(missing_ok=True)
        path.write_bytes(spoilt)
        try:
            with Record.open(run) as record:
                found, named = contents(record), record.damaged()
        except InputError as error:
            refused.append(str(error))
            continue
        missing = sum(len(whole[name]) for name in whole) - sum(len(v) for v in found.values())
        assert all(set(found[name]) <= set(whole[name]) for name in whole)
        assert found["readings"] == [r for r in whole["readings"] if r in found["readings"]]
        assert missing == len(named)
        left_out += bool(named)
    assert left_out > 3
    assert len(refused) > 5
    assert all(text.startswith(str(run)) for text in refused)
