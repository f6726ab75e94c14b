"""Run record: durable at once, readable during the scan, refused if it is foreign."""

from __future__ import annotations

import os
import sqlite3
from pathlib import Path

import pytest

from instrument.errors import InputError
from instrument.record.reading import Preview
from instrument.record.record import FILE_NAME, Record
from tests.support.storage.sample_records import reading


def test_added_rows_are_read_back_unchanged(tmp_path: Path) -> None:
    rows = [reading(0), reading(1, kind="tile", flags="saturated")]
    picture = Preview(1, "a view", b"\x89PNG", [[0.0, 1.5], [2.0, 3.0]])
    with Record.create(tmp_path / "run", {"protocol": "text"}) as record:
        record.add_device("camera", "somebody")
        record.add_dark("2026", 0.032, 8, 64.0, 1.1)
        record.add_event("2026", "operator", "done")
        record.add_reading(rows[0])
        record.add_reading(rows[1], picture)
    with Record.open(tmp_path / "run") as record:
        assert record.readings() == rows
        assert record.previews() == [picture]
        assert record.devices() == {"camera": "somebody"}
        assert record.darks() == [(0.032, 8, 64.0, 1.1)]
        assert list(record.events()) == [("2026", "operator", "done")]
        assert record.meta("protocol") == "text"
        assert record.meta("nothing") is None


def test_another_tool_reads_it_while_the_scan_runs(tmp_path: Path) -> None:
    with Record.create(tmp_path / "run", {}) as record:
        record.add_reading(reading())
        other = sqlite3.connect(f"file:{tmp_path / 'run' / FILE_NAME}?mode=ro", uri=True)
        assert other.execute("SELECT theta_r_deg FROM reading").fetchall() == [(-20.0,)]
        assert other.execute("PRAGMA journal_mode").fetchone() == ("wal",)
        other.close()
        assert record.meta("schema_version") == "8"


def test_a_value_that_could_not_be_measured_stays_unknown(tmp_path: Path) -> None:
    with Record.create(tmp_path / "run", {}) as record:
        record.add_reading(reading(signal_dn=float("nan")))
        assert record.readings()[0].signal_dn != record.readings()[0].signal_dn


def test_the_same_step_is_never_accepted_twice(tmp_path: Path) -> None:
    with Record.create(tmp_path / "run", {}) as record:
        record.add_reading(reading())
        with pytest.raises(sqlite3.IntegrityError):
            record.add_reading(reading())


def test_a_folder_with_something_in_it_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="must be absent or an empty folder"):
        Record.create(tmp_path, {})
    assert [p.name for p in tmp_path.iterdir()] == ["notes.txt"]


def test_no_record_a_foreign_file_and_another_version_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no record\.sqlite there"):
        Record.open(tmp_path)
    (tmp_path / FILE_NAME).write_text("not a database, but long enough to look like one" * 40)
    with pytest.raises(InputError, match="not a record of this program"):
        Record.open(tmp_path)
    with Record.create(tmp_path / "run", {}) as record:
        record.set_meta("schema_version", "99")
    with pytest.raises(InputError, match="schema version 99; this program reads 3, 4, 5, 6"):
        Record.open(tmp_path / "run")


def test_one_process_at_a_time_scans_into_a_run(tmp_path: Path) -> None:
    with Record.create(tmp_path / "run", {}) as record:
        with record.claimed(), Record.open(tmp_path / "run") as other:
            words = rf"process {os.getpid()} is scanning into this run"
            with pytest.raises(InputError, match=words), other.claimed():
                raise AssertionError("claimed twice")
        with record.claimed() as again:
            assert again is None


def test_no_record_on_a_network_share(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("instrument.record.schema.network_share", lambda _: "nfs4")
    for way in (lambda: Record.create(tmp_path / "run", {}), lambda: Record.open(tmp_path)):
        with pytest.raises(InputError, match=r"network share \(nfs4\).*a folder on a local disk"):
            way()
    assert not (tmp_path / "run").exists()


def test_a_python_with_an_old_sqlite_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sqlite3, "sqlite_version_info", (3, 36, 0))
    with pytest.raises(InputError, match=r"needed: 3\.37\.0 or later: use another Python"):
        Record.create(tmp_path / "run", {})
    assert not (tmp_path / "run").exists()


def test_texts_of_any_bytes_are_stored_readably(tmp_path: Path) -> None:
    """As the name of a protocol's file gives them, which need be no UTF-8."""
    name = os.fsdecode(b"pr\xff\xc3\xb6.yaml")
    with Record.create(tmp_path / name, {"protocol_file": name}) as record:
        record.add_event("2026", "fault", f"{name}: gone")
    with Record.open(tmp_path / name) as record:
        assert record.meta("protocol_file") == r"pr\udcffö.yaml"
        assert list(record.events()) == [("2026", "fault", r"pr\udcffö.yaml: gone")]
        assert record.damaged() == ()
