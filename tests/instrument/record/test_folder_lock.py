"""Lock on a run's folder: one process at a time, and only files of one's own making are removed."""

from __future__ import annotations

import os
import sqlite3
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from acquisition.commands.scan import resume_run
from instrument.errors import InputError
from instrument.record import record as module
from instrument.record.folder_lock import FolderLock
from instrument.record.record import FILE_NAME, Record
from tests.support.paths import ROOT
from tests.support.storage.sample_records import reading, small_record

HOLD = (
    "import sys; from pathlib import Path; from instrument.record.folder_lock import FolderLock\n"
    "with FolderLock(Path(sys.argv[1])): print('held', flush=True); sys.stdin.read()"
)


def test_no_file_holds_the_lock_and_it_ends_with_the_process(tmp_path: Path) -> None:
    """Whatever is removed from the folder, a second process is refused and the first is named."""
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], cwd=ROOT, text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    ) as first:  # fmt: skip
        assert first.stdout is not None
        assert first.stdout.readline() == "held\n"
        assert list(tmp_path.iterdir()) == []
        with pytest.raises(InputError, match=f"process {first.pid} is scanning into this run"):
            FolderLock(tmp_path)
        first.kill()
    FolderLock(tmp_path).close()


def test_a_folder_that_cannot_be_locked_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no: cannot be locked \(No such file or directory\)"):
        FolderLock(tmp_path / "no")


def test_a_resume_reads_nothing_before_it_has_the_lock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small_record(tmp_path / "run").close()
    monkeypatch.setattr(module, "connect", lambda _: pytest.fail("read without the lock"))
    with (
        FolderLock(tmp_path / "run"),
        pytest.raises(InputError, match=f"process {os.getpid()} is scanning into this run"),
    ):
        resume_run(tmp_path / "run", yes=True, as_json=True)


def test_a_new_record_is_locked_from_its_first_file_on(tmp_path: Path) -> None:
    with Record.create(tmp_path / "run", {}) as record:
        with pytest.raises(InputError, match="is scanning into this run"):
            Record.open(tmp_path / "run", claim=True)
        with record.claimed(), pytest.raises(InputError, match="is scanning into this run"):
            FolderLock(tmp_path / "run")
        FolderLock(tmp_path / "run").close()


class Race:
    """Several threads that create a record in one folder at the same moment."""

    def __init__(self, folder: Path, runs: int) -> None:
        self.won, self.refused = list[str](), list[str]()
        self._folder, self._ready = folder, threading.Barrier(runs)
        threads = [threading.Thread(target=self._create, args=(str(n),)) for n in range(runs)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    def _create(self, name: str) -> None:
        self._ready.wait()
        try:
            with Record.create(self._folder, {"protocol": name}) as record:
                record.add_reading(reading())
                self.won.append(name)
        except InputError as error:
            self.refused.append(str(error))


def test_of_runs_into_one_folder_at_once_one_wins_and_keeps_its_files(tmp_path: Path) -> None:
    """The others are refused; whoever makes the folder first need not be the one that wins."""
    for number in range(25):
        race = Race(tmp_path / str(number), 4)
        assert (len(race.won), len(race.refused)) == (1, 3), race.refused
        words = ("is scanning into this run", "--out must be absent or an empty folder")
        assert all(any(w in text for w in words) for text in race.refused)
        with Record.open(tmp_path / str(number)) as record:
            assert record.meta("protocol") == race.won[0]
            assert len(record.readings()) == 1


@pytest.mark.parametrize("existed", [False, True])
def test_a_record_that_cannot_be_begun_leaves_what_it_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, existed: bool
) -> None:
    folder = tmp_path / "run"
    if existed:
        folder.mkdir()

    def fails(*_: object) -> None:
        raise sqlite3.OperationalError("disk I/O error")

    monkeypatch.setattr(module, "_begin", fails)
    with pytest.raises(InputError, match=r"no run can be written there: .*disk I/O error"):
        Record.create(folder, {})
    assert folder.exists() == existed
    assert not list(tmp_path.rglob("*.sqlite*"))


def test_files_that_another_program_put_there_meanwhile_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A note, and even another file under the record's name."""

    def replaced(*_: object) -> None:
        (tmp_path / "run" / FILE_NAME).unlink()
        (tmp_path / "run" / FILE_NAME).write_text("not mine")
        (tmp_path / "run" / "note.txt").write_text("not mine")
        raise sqlite3.OperationalError("disk I/O error")

    monkeypatch.setattr(module, "_begin", replaced)
    with pytest.raises(InputError, match="no run can be written there"):
        Record.create(tmp_path / "run", {})
    for name in (FILE_NAME, "note.txt"):
        assert (tmp_path / "run" / name).read_text() == "not mine"
