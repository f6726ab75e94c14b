"""The program that holds a record is named, with its process number."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest

from instrument import processes
from instrument.record import lock_holder as module
from instrument.record.lock_holder import lock_holder
from instrument.record.record import FILE_NAME, Record
from tests.support.storage.holder import held


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
    monkeypatch.setattr(module, "locking", lambda *_: iter(()))
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
