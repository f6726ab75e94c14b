"""A record that another program holds: the writer waits, says for whom, and gives up in time."""

from __future__ import annotations

import logging
import signal
import sqlite3
import threading
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest

from instrument import processes
from instrument.clock import SystemClock
from instrument.errors import StorageError
from instrument.record import write_lock
from instrument.record.record import FILE_NAME, Record
from instrument.record.write_lock import NOTICE_S, PATIENCE_S, begin_writing, lock_holder
from tests.support.storage.holder import held


class On(logging.Handler):
    """Calls a function at the first message, and keeps all of them."""

    def __init__(self, action: Callable[[], None]) -> None:
        super().__init__()
        self.messages: list[str] = []
        self._action = action

    def emit(self, record: logging.LogRecord) -> None:
        self.messages.append(record.getMessage())
        self._action()


def test_a_writer_waits_for_another_program_and_then_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(write_lock, "NOTICE_S", 0.0)
    with Record.create(tmp_path / "run", {}) as record, held(record.folder / FILE_NAME) as holder:
        handler = On(holder.release)
        monkeypatch.setattr(write_lock.log, "handlers", [handler])
        record.add_event("2026", "operator", "done")
        assert list(record.events()) == [("2026", "operator", "done")]
    (message,) = handler.messages
    assert f"{FILE_NAME}: process {holder.pid} (" in message
    assert "save or discard the changes there, or close it; waiting 60 s for it" in message


class Waited:
    """Clock that only `sleep` advances."""

    def __init__(self) -> None:
        self.time_s = 100.0

    def now_s(self) -> float:
        return self.time_s

    def utc(self) -> datetime:
        return datetime.now(UTC)

    def sleep(self, seconds: float) -> None:
        self.time_s += 10 * seconds


def test_a_writer_gives_up_after_a_minute(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    clock = Waited()
    with Record.create(tmp_path / "run", {}):
        pass
    file = tmp_path / "run" / FILE_NAME
    database = sqlite3.connect(file, timeout=0)
    with held(file) as holder, pytest.raises(StorageError) as failed:
        begin_writing(database, file, clock)
    database.close()
    assert f"process {holder.pid} (" in str(failed.value)
    assert "holds the record for 60 s: save or discard the changes there" in str(failed.value)
    assert PATIENCE_S < clock.time_s - 100.0 < PATIENCE_S + 1.0
    assert len(caplog.messages) == 1
    assert NOTICE_S < PATIENCE_S / 10


def test_a_wait_ends_at_once_with_a_signal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SQLite's own wait would hold a Ctrl-C back; what waits for the lock is written once."""

    class Struck(SystemClock):
        """Clock of a wait that is interrupted, once, when it has begun."""

        def sleep(self, seconds: float) -> None:
            if not strikes:
                strikes.append(signal.SIGINT)
                signal.pthread_kill(main, signal.SIGINT)
            super().sleep(seconds)

    main, strikes = threading.get_ident(), list[signal.Signals]()
    monkeypatch.setattr(write_lock, "SystemClock", Struck)
    with Record.create(tmp_path / "run", {}) as record:
        with held(record.folder / FILE_NAME):
            begun_s = time.monotonic()
            with pytest.raises(KeyboardInterrupt):
                record.add_event("2026", "operator", "at last")
            assert time.monotonic() - begun_s < PATIENCE_S / 10
        record.add_event("2026", "stopped", "by the operator")
        assert [text for _, _, text in record.events()] == ["at last", "by the operator"]


def test_a_record_held_from_reading_is_not_called_foreign(tmp_path: Path) -> None:
    with Record.create(tmp_path / "run", {}):
        pass
    file = tmp_path / "run" / FILE_NAME
    with (
        held(file, "PRAGMA locking_mode=EXCLUSIVE") as holder,
        pytest.raises(StorageError, match=f"process {holder.pid} .* holds the record: save"),
    ):
        Record.open(tmp_path / "run")


def test_the_process_that_holds_the_write_lock_is_named(tmp_path: Path) -> None:
    """Readers are not, and the scan itself is not."""
    file = tmp_path / "run" / FILE_NAME
    with Record.create(tmp_path / "run", {}) as record, held(file) as holder:
        reader = sqlite3.connect(file)
        reader.execute("BEGIN")
        assert record.readings() == reader.execute("SELECT * FROM reading").fetchall() == []
        found = lock_holder(file)
        assert found.startswith(f"process {holder.pid} (")
        assert "tests.support.storage.holder" in found or found.endswith("...)")
        reader.close()


def test_without_the_kernels_table_those_that_have_it_open_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "run" / FILE_NAME
    monkeypatch.setattr(write_lock, "locking", lambda *_: iter(()))
    with Record.create(tmp_path / "run", {}):
        assert lock_holder(file) == "another program"
        with held(file) as holder:
            expected = f"one of those that have it open: process {holder.pid} ("
            assert lock_holder(file).startswith(expected)


def test_a_command_line_is_printable_and_short(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "record.sqlite-shm").touch()
    inode = (tmp_path / "record.sqlite-shm").stat().st_ino
    (tmp_path / "locks").write_text(
        f"1: POSIX  ADVISORY  WRITE 12 08:01:{inode} 120 120\n"
        f"1: -> POSIX  ADVISORY  WRITE 13 08:01:{inode} 120 120\n"
        f"2: POSIX  ADVISORY  READ 14 08:01:{inode} 124 124\n"
        f"3: POSIX  ADVISORY  WRITE 15 08:01:{inode} 128 128\n"
        f"4: FLOCK  ADVISORY  WRITE 16 08:01:1{inode} 0 EOF\n"
        f"5: POSIX  ADVISORY  WRITE 0 08:01:{inode} 120 120\n"
    )
    (tmp_path / "12").mkdir()
    (tmp_path / "12" / "cmdline").write_bytes(b"edit\x1b[2J\0" + b"\xff" + b"x" * 100)
    monkeypatch.setattr(processes, "_PROC", tmp_path)
    found = lock_holder(tmp_path / "record.sqlite")
    assert found.startswith("process 12 (edit\\x1b[2J \ufffdxxx")
    assert found.endswith("xxx...)")
    assert len(found) < 90
