"""The run record: one SQLite file a run, where acquiring and analysing meet.

Write-ahead log and `synchronous=FULL`: what has been committed survives the process and the power.
Any SQLite tool can read it while the scan runs. Counts (DN) are stored as measured; radiance and
BRDF are worked out from them afterwards, so nothing that a value came from is lost.
"""

from __future__ import annotations

import fcntl
import json
import math
import os
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import astuple
from pathlib import Path
from typing import Any

from instrument.closeable import Closing
from instrument.devices import Frame
from instrument.errors import GonioError, InputError, StorageError
from instrument.record.network_share import network_share
from instrument.record.reading import Check, Preview, Reading
from instrument.record.schema import MARKS, begin, connect
from instrument.record.validation import check_files, check_schema, check_values
from instrument.text.atomic_file import full, make_folder, sync_folder, trouble

FILE_NAME = "record.sqlite"
LOCK_NAME = ".scanning"
_CLOSED_TO_US = ("SQLITE_READONLY", "SQLITE_PERM", "SQLITE_CANTOPEN")


class Record(Closing):
    """An open record; use it with `with`. Every `add_` is on disk when it returns."""

    def __init__(self, connection: sqlite3.Connection, folder: Path) -> None:
        self._db = connection
        self.folder = folder
        self._file = (folder / FILE_NAME).stat()

    @classmethod
    def create(cls, folder: Path, meta: Mapping[str, str]) -> Record:
        """Start a record in `folder`, which must be absent or empty; else `InputError`."""
        _refuse_network_share(folder)
        try:
            if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
                raise InputError(
                    f"{folder}: --out must be absent or an empty folder: name another, or leave "
                    "it out"
                )
            make_folder(folder)
            database = connect(folder / FILE_NAME)
            begin(database, meta)
            sync_folder(folder)
        except (OSError, sqlite3.Error) as error:
            why = _trouble(error, folder)
            _unmake(folder)
            raise InputError(f"{folder}: no run can be written there: {why}") from error
        return cls(database, folder)

    @classmethod
    def open(cls, folder: Path) -> Record:
        """Open the record of an earlier run; `InputError` when there is none or it is foreign."""
        _refuse_network_share(folder)
        path = folder / FILE_NAME
        if not path.is_file():
            raise InputError(f"{folder}: no {FILE_NAME} there: name the folder of a run")
        check_files(folder, FILE_NAME, LOCK_NAME)
        try:
            record = cls(connect(path), folder)
        except (sqlite3.Error, UnicodeDecodeError) as error:
            raise _refused(error, path) from error
        try:
            check_values(record._db, path, check_schema(record._db, path))
        except (sqlite3.Error, UnicodeDecodeError) as error:  # names and texts of any bytes
            record.close()
            raise _refused(error, path) from error
        except InputError:
            record.close()
            raise
        return record

    @contextmanager
    def claimed(self) -> Iterator[None]:
        """Keep other processes from scanning into this run; the system lets go when we die.

        Raises `InputError` that names the process which scans already.
        """
        with (self.folder / LOCK_NAME).open("a+") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                lock.seek(0)
                raise InputError(
                    f"{self.folder}: process {lock.read().strip()} is scanning into this run: "
                    "wait for its end, or stop it"
                ) from error
            lock.truncate(0)
            lock.write(str(os.getpid()))
            lock.flush()
            yield

    def close(self) -> None:
        """Close the file; safe twice."""
        self._db.close()

    def where(self) -> Path | None:
        """The folder in which the record's file is now, also when it was moved; None: removed."""
        found = _path_of(self._file)
        return found.parent if found is not None and found.is_file() else None

    def meta(self, key: str) -> str | None:
        """One entry of the run's description."""
        row = self._db.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
        return None if row is None else str(row[0])

    def set_meta(self, key: str, value: str) -> None:
        """Set one entry of the run's description."""
        self._write("INSERT OR REPLACE INTO meta VALUES (?, ?)", (key, value))

    def add_device(self, role: str, identity: str) -> None:
        """Write down which device answered."""
        self._write("INSERT OR REPLACE INTO device VALUES (?, ?)", (role, identity))

    def add_settings(self, time_utc: str, role: str, settings: Mapping[str, str]) -> None:
        """Write down what a device says that it is set to."""
        with self._writing() as database:
            rows = [(time_utc, role, *setting) for setting in settings.items()]
            database.executemany("INSERT INTO setting VALUES (NULL, ?, ?, ?, ?)", rows)

    def add_event(self, time_utc: str, kind: str, text: str) -> None:
        """Write down what happened: a prompt and its answer, a stop, a retry, a fault, the end."""
        self._write("INSERT INTO event VALUES (NULL, ?, ?, ?)", (time_utc, kind, text))

    def add_dark(
        self, time_utc: str, exposure_s: float, frames: int, mean_dn: float, noise_dn: float
    ) -> None:
        """Write down a dark: mean count and temporal noise of one pixel."""
        row = (time_utc, exposure_s, frames, mean_dn, noise_dn)
        self._write("INSERT INTO dark VALUES (NULL, ?, ?, ?, ?, ?)", row)

    def add_reading(
        self,
        reading: Reading,
        preview: Preview | None = None,
        frames: Sequence[Frame] = (),
        files: Sequence[str] = (),
    ) -> None:
        """Accept a measured geometry in one transaction: its picture if one is kept, its frames.

        Of a frame are kept its exposure, when it was read, the camera's own time stamp, and the
        file in the run's folder that holds it, if one does.
        """
        names: Sequence[str | None] = files or [None] * len(frames)
        rows = [
            (reading.step, number, frame.exposure_s, frame.time_s, frame.device_time_s, name)
            for number, (frame, name) in enumerate(zip(frames, names, strict=True))
        ]
        with self._writing() as database:
            database.executemany("INSERT INTO frame VALUES (?, ?, ?, ?, ?, ?)", rows)
            database.execute(f"INSERT INTO reading VALUES ({MARKS})", astuple(reading))
            if preview is not None:
                row = (preview.step, preview.caption, preview.png, json.dumps(preview.polygon))
                database.execute("INSERT INTO preview VALUES (?, ?, ?, ?)", row)

    def add_check(self, check: Check) -> None:
        """Write down the drift reference as it was found when the scan went on."""
        head = (check.before_step, check.expected, check.u_expected, check.jumped)
        row = (*head, *astuple(check.reading))
        self._write(f"INSERT INTO drift_at_resume VALUES (?, ?, ?, ?, {MARKS})", row)

    def readings(self) -> list[Reading]:
        """All measured geometries in the plan's order."""
        rows = self._db.execute("SELECT * FROM reading ORDER BY step").fetchall()
        return [Reading(*_with_nan(row)) for row in rows]

    def checks(self) -> list[Check]:
        """The drift references that were measured when the scan went on, in order."""
        rows = self._db.execute("SELECT * FROM drift_at_resume ORDER BY rowid").fetchall()
        return [
            Check(a, b, u, bool(jumped), Reading(*_with_nan(tuple(row))))
            for a, b, u, jumped, *row in rows
        ]

    def settings(self) -> dict[str, dict[str, str]]:
        """What each device said last that it is set to, by its role."""
        found: dict[str, dict[str, str]] = {}
        rows = self._db.execute("SELECT role, name, value FROM setting ORDER BY id")
        for role, name, value in rows:
            found.setdefault(role, {})[name] = value
        return found

    def frame_files(self) -> list[str]:
        """The files of all kept frames, relative to the run's folder."""
        sql = "SELECT file FROM frame WHERE file IS NOT NULL ORDER BY step, number"
        return [name for (name,) in self._db.execute(sql)]

    def previews(self) -> list[Preview]:
        """All kept pictures in the plan's order."""
        rows = self._db.execute("SELECT * FROM preview ORDER BY step")
        return [Preview(step, text, png, json.loads(outline)) for step, text, png, outline in rows]

    def devices(self) -> dict[str, str]:
        """Role and identity of every device."""
        return dict(self._db.execute("SELECT role, identity FROM device ORDER BY role"))

    def darks(self) -> list[tuple[float, int, float, float]]:
        """Exposure (s), frames, mean and noise (DN) of every dark, in order of exposure."""
        sql = "SELECT exposure_s, frames, mean_dn, noise_dn FROM dark ORDER BY exposure_s, id"
        return list(self._db.execute(sql))

    def events(self) -> Iterator[tuple[str, str, str]]:
        """Time, kind and text of every event in order."""
        yield from self._db.execute("SELECT time_utc, kind, text FROM event ORDER BY id")

    def _write(self, sql: str, row: Sequence[object]) -> None:
        with self._writing() as database:
            database.execute(sql, row)

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """One transaction, whole or not at all; `StorageError` where the disk does not take it."""
        self._require_same_file()
        try:
            with self._db:
                yield self._db
        except sqlite3.IntegrityError:
            raise  # the program's mistake and not the disk's
        except sqlite3.Error as error:
            path = self.folder / FILE_NAME
            raise StorageError(f"{path}: {_trouble(error, self.folder)}") from error

    def _require_same_file(self) -> None:
        """What is written must be found again: a moved or removed file takes nothing more."""
        path = self.folder / FILE_NAME
        try:
            same = _same(path.stat(), self._file)
        except OSError:
            same = False
        if not same:
            raise StorageError(f"{path}: {_fate(self._file)}")


def _refused(error: Exception, path: Path) -> GonioError:
    """Why a file cannot be opened as a record."""
    if isinstance(error, sqlite3.Error) and _name_of(error).startswith(_CLOSED_TO_US):
        return StorageError(f"{path}: {_trouble(error, path.parent)}")
    return InputError(f"{path}: not a record of this program: {error}")


def _same(one: os.stat_result, other: os.stat_result) -> bool:
    return (one.st_dev, one.st_ino) == (other.st_dev, other.st_ino)


def _path_of(file: os.stat_result) -> Path | None:
    """The path that a file which we have open has now; one that names no file was removed."""
    for link in Path("/proc/self/fd").iterdir():
        try:
            if _same(link.stat(), file):
                return link.readlink()
        except OSError:
            continue  # closed meanwhile: the folder's own listing
    return None


def _fate(file: os.stat_result) -> str:
    """What became of the record's file, which is no longer where it was."""
    now = _path_of(file)
    if now is None or not now.is_file():
        return "was removed while the scan ran, and the readings with it: run again"
    return "was moved while the scan ran: nothing accepted is lost"


def _unmake(folder: Path) -> None:
    """Leave nothing of a record that could not be begun, so that the next try finds room."""
    for name in (FILE_NAME, f"{FILE_NAME}-wal", f"{FILE_NAME}-shm", f"{FILE_NAME}-journal"):
        with suppress(OSError):
            (folder / name).unlink()
    with suppress(OSError):
        folder.rmdir()


def _name_of(error: sqlite3.Error) -> str:
    return str(getattr(error, "sqlite_errorname", ""))


def _trouble(error: OSError | sqlite3.Error, folder: Path) -> str:
    """What the disk or SQLite met, in words, and what to do about it."""
    if isinstance(error, OSError):
        return trouble(error, folder)
    name = _name_of(error)
    if name == "SQLITE_FULL":
        return full(folder)
    if name.startswith(_CLOSED_TO_US):
        return f"cannot be written ({error}): look at the folder's permissions and its disk"
    return f"cannot be written ({error}): look at the disk"


def _refuse_network_share(folder: Path) -> None:
    share = network_share(folder)
    if share is not None:
        raise InputError(
            f"{folder}: lies on a network share ({share}), where the record is not safe: name a "
            "folder on a local disk, and copy the run afterwards"
        )


def _with_nan(row: tuple[Any, ...]) -> tuple[Any, ...]:
    """SQLite keeps no nan: it stores NULL."""
    return tuple(math.nan if value is None else value for value in row)
