"""Reader of a run that is being scanned: it sees whole states, and the scan never waits for it."""

from __future__ import annotations

import sqlite3
import threading
from contextlib import closing
from pathlib import Path

import pytest

from acquisition.live.following.run_reader import RunReader
from acquisition.plan.plan import make_plan
from acquisition.results.run_folder import run_meta
from instrument.errors import InputError
from instrument.record import write_lock
from instrument.record.reading import Rows
from instrument.record.record import FILE_NAME, Record
from tests.support.live.runs import begun_run, live_protocol
from tests.support.timing.deadline import wait_for
from tests.support.whole_scans.stopped_scan import scan

NOW = "2026-11-28T05:00:00+00:00"


def test_only_a_change_is_read_again(tmp_path: Path) -> None:
    loaded, run = live_protocol(tmp_path), tmp_path / "run"
    with begun_run(loaded, run) as record, RunReader(run) as reader:
        assert reader.changed_rows() is not None
        assert reader.changed_rows() is None
        record.add_event(NOW, "retry", "once")
        rows = reader.changed_rows()
        assert rows is not None
        assert rows.events[-1] == (NOW, "retry", "once")
        assert reader.changed_rows() is None


def test_a_reader_in_the_midst_of_reading_holds_up_no_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The longest that a reader can do to a writer: a transaction that it never ends.

    Busy would be raised at once: no patience is left.
    """
    monkeypatch.setattr(write_lock, "PATIENCE_S", 0.0)
    loaded, run = live_protocol(tmp_path), tmp_path / "run"
    with begun_run(loaded, run) as record, closing(sqlite3.connect(run / FILE_NAME)) as reading:
        record._db.execute("PRAGMA busy_timeout=0")
        reading.execute("BEGIN")
        assert reading.execute("SELECT COUNT(*) FROM reading").fetchone() == (0,)
        scan(loaded, record, upto=4)
        assert reading.execute("SELECT COUNT(*) FROM reading").fetchone() == (0,)
        reading.rollback()
        assert reading.execute("SELECT COUNT(*) FROM reading").fetchone() == (5,)


def test_rows_of_one_moment_belong_together(tmp_path: Path) -> None:
    """A writer adds an event and changes the readings in one transaction, again and again."""
    loaded, run = live_protocol(tmp_path), tmp_path / "run"
    over, seen = threading.Event(), list[Rows]()

    def look(reader: RunReader) -> bool:
        rows = reader.changed_rows()
        if rows is not None and len({text for *_, text in rows.events}) == 1:
            seen.append(rows)
        return len(seen) >= 10

    def write() -> None:
        with closing(sqlite3.connect(run / FILE_NAME, timeout=10)) as database:
            count = 0
            while not over.is_set():
                with database:
                    count += 1
                    database.execute("UPDATE reading SET frames = ?", (count,))
                    database.execute("UPDATE event SET text = ?", (str(count),))

    with begun_run(loaded, run) as record:
        scan(loaded, record, upto=2)
        thread = threading.Thread(target=write)
        with RunReader(run) as reader:
            thread.start()
            try:
                wait_for(lambda: look(reader), "ten changes")
            finally:
                over.set()
                thread.join()
    for rows in seen:
        assert {str(r.frames) for r in rows.readings} == {text for *_, text in rows.events}


def test_nothing_in_the_folder_is_changed_by_reading(tmp_path: Path) -> None:
    loaded, run = live_protocol(tmp_path), tmp_path / "run"
    with begun_run(loaded, run) as record:
        scan(loaded, record, upto=2)
    before = (run / FILE_NAME).read_bytes()
    with RunReader(run) as reader:
        assert reader.changed_rows() is not None
    assert (run / FILE_NAME).read_bytes() == before


def test_a_folder_without_inputs_is_refused(tmp_path: Path) -> None:
    loaded = live_protocol(tmp_path)
    with Record.create(tmp_path / "run", run_meta(loaded, make_plan(loaded))):
        pass
    with pytest.raises(InputError, match=r"protocol\.yaml"):
        RunReader(tmp_path / "run")
