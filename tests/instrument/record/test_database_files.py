"""Log and index of a record that are removed or cut while it is written: noticed, rows saved."""

from __future__ import annotations

import os
import shutil
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from instrument.errors import StorageError
from instrument.record.record import FILE_NAME, Record
from tests.support.storage.sample_records import reading

COUNT = "SELECT COUNT(*) FROM reading"
REMOVED = [("-wal",), ("-shm",), ("-wal", "-shm")]


def killed_copy(run: Path) -> Path:
    """The files as a killed process leaves them: nothing is closed or written any more."""
    return Path(shutil.copytree(run, run.parent / "killed"))


def steps(run: Path) -> list[int]:
    with Record.open(run) as record:
        return [r.step for r in record.readings()]


@pytest.mark.parametrize("ends", REMOVED)
def test_a_removed_log_is_named_and_no_accepted_reading_is_lost(
    tmp_path: Path, ends: tuple[str, ...]
) -> None:
    """Not by a kill after that either."""
    with Record.create(tmp_path / "run", {}) as record:
        for step in range(10):
            record.add_reading(reading(step))
        for end in ends:
            (tmp_path / "run" / f"{FILE_NAME}{end}").unlink()
        with pytest.raises(StorageError) as failed:
            record.add_reading(reading(10))
        assert f"{FILE_NAME}{ends[0]} was removed while the scan ran" in str(failed.value)
        assert "the accepted readings have been moved into the database and are safe" in str(
            failed.value
        )
        assert len(record.readings()) == 10
        assert steps(killed_copy(tmp_path / "run")) == list(range(10))
    assert steps(tmp_path / "run") == list(range(10))


def test_a_replaced_log_is_named(tmp_path: Path) -> None:
    """A copy of the same bytes is not the file that is written to."""
    with Record.create(tmp_path / "run", {}) as record:
        record.add_reading(reading(0))
        log = tmp_path / "run" / f"{FILE_NAME}-wal"
        shutil.copy(log, tmp_path / "copy")
        (tmp_path / "copy").replace(log)
        with pytest.raises(
            StorageError, match="-wal was replaced while the scan ran: the accepted"
        ):
            record.add_reading(reading(1))


def test_a_cut_index_is_named_and_nothing_is_lost(tmp_path: Path) -> None:
    """It is mapped to memory: a process that touches what is missing gets SIGBUS."""
    with Record.create(tmp_path / "run", {}) as record:
        for step in range(10):
            record.add_reading(reading(step))
        os.truncate(tmp_path / "run" / f"{FILE_NAME}-shm", 0)
        with pytest.raises(StorageError, match="-shm was cut while the scan ran: the accepted"):
            record.add_reading(reading(10))
    assert steps(tmp_path / "run") == list(range(10))


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3, 0.55, 0.8, 0.9, 0.97, 0.999])
def test_a_cut_log_is_named_and_what_it_still_holds_is_kept(tmp_path: Path, share: float) -> None:
    """The rows before the cut; with all of the log gone, those that the database itself has."""
    with Record.create(tmp_path / "run", {}) as record:
        record.add_reading(reading(0))
        record._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        for step in range(1, 30):
            record.add_reading(reading(step))
        log = tmp_path / "run" / f"{FILE_NAME}-wal"
        os.truncate(log, int(share * log.stat().st_size))
        with pytest.raises(StorageError, match="-wal was cut while the scan ran: the latest"):
            record.add_reading(reading(30))
    found = steps(tmp_path / "run")
    assert found == list(range(len(found)))
    assert 1 <= len(found) < 30


@pytest.mark.parametrize("way", ["wal_checkpoint(TRUNCATE)", "wal_checkpoint(RESTART)", "optimize"])
def test_another_tool_that_empties_the_log_properly_is_no_loss(tmp_path: Path, way: str) -> None:
    with Record.create(tmp_path / "run", {}) as record:
        for step in range(20):
            record.add_reading(reading(step))
            if step % 6 == 5:
                other = sqlite3.connect(tmp_path / "run" / FILE_NAME)
                other.execute(f"PRAGMA {way}")
                other.close()
    assert steps(tmp_path / "run") == list(range(20))


def test_the_locks_of_the_writer_stay_while_its_files_are_watched(tmp_path: Path) -> None:
    """A process loses its locks on a file when it closes any descriptor of it.

    Another program that finds no lock on the index empties it, and the writer gets SIGBUS.
    """
    file = tmp_path / "run" / FILE_NAME
    with Record.create(tmp_path / "run", {}) as record:
        for step in range(3):
            record.add_reading(reading(step))
        locked = [byte for byte in range(120, 129) if _locked(Path(f"{file}-shm"), byte)]
        assert 128 in locked  # "DMS", by which SQLite knows that others use the index
        look = (
            f"import sqlite3; print(*sqlite3.connect({str(file)!r}).execute({COUNT!r}).fetchone())"
        )
        for step in range(3, 6):
            done = subprocess.run(
                [sys.executable, "-c", look], capture_output=True, text=True, check=True
            )
            assert done.stdout == f"{step}\n"
            record.add_reading(reading(step))


def _locked(file: Path, byte: int) -> bool:
    """Return True if a process holds a lock, shared or not, on a byte of the file."""
    inode = str(file.stat().st_ino)
    for words in map(str.split, Path("/proc/locks").read_text().splitlines()):
        own = words[-3].rpartition(":")[2] == inode and words[-1] != "EOF"
        if own and int(words[-2]) <= byte <= int(words[-1]):
            return True
    return False
