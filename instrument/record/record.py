"""Run record: one SQLite file per run, which the scan writes and the analysis reads.

Write-ahead log and `synchronous=FULL`: a committed row survives a kill and a power cut. Any SQLite
tool can read the file during the scan. Counts (DN) are stored as measured; radiance and BRDF are
computed from them afterwards, so the raw data of every value are kept.
"""

from __future__ import annotations

import json
import math
import sqlite3
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import astuple, fields
from os.path import samestat
from pathlib import Path
from typing import Any

from instrument.closeable import Closeable
from instrument.devices import Frame
from instrument.errors import GonioError, InputError, StorageError
from instrument.record.database_files import (
    SideFiles,
    absence_text,
    create_file,
    no_record_text,
    path_of,
    remove_database,
)
from instrument.record.folder_lock import FolderLock
from instrument.record.reading import Check, Preview, Reading, Rows
from instrument.record.schema import (
    SCHEMA_VERSION,
    connect,
    create_tables,
    has_seals,
    require_support,
    tables_of,
)
from instrument.record.seal import Damaged, sealed, storable
from instrument.record.validation import check_files, check_schema, check_values
from instrument.record.write_lock import begin_writing, held_by_another, is_busy
from instrument.record.write_thread import WriteThread
from instrument.text.atomic_file import disk_full, explain_os_error, make_folder, sync_folder

FILE_NAME = "record.sqlite"
_NewRows = Sequence[Sequence[object]]
_READING = [field.name for field in fields(Reading)]
_SAVED = "the accepted readings have been moved into the database and are safe"
_LOST = "the latest readings, which only it held, are lost and have to be measured again"
_TAKEN = "--out must be absent or an empty folder: name another, or leave it out"
_NOT_PERMITTED = ("SQLITE_READONLY", "SQLITE_PERM", "SQLITE_CANTOPEN")


class Record(Closeable):
    """Open record; use it with `with`. Every `add_...` is on disk when it returns.

    `writing` is the thread that writes, for a caller who has something else to do meanwhile.
    Rows that were damaged since they were written are left out of everything that it returns.
    """

    def __init__(
        self, connection: sqlite3.Connection, folder: Path, lock: FolderLock | None = None
    ) -> None:
        self._db = connection
        self.folder, self._lock = folder, lock
        self._file = (folder / FILE_NAME).stat()
        self._version = SCHEMA_VERSION
        self._damaged: Damaged = {}
        self._replaceable: Container[int] = ()
        self._side_files = SideFiles(folder / FILE_NAME)
        self.writing = WriteThread(folder / FILE_NAME)

    @classmethod
    def create(cls, folder: Path, meta: Mapping[str, str]) -> Record:
        """Create a record in `folder`, which must be absent or empty; else `InputError`.

        The folder is locked against a second scan until the record is closed, or `claimed` ends.
        """
        require_support(folder)
        with ExitStack() as on_failure:
            try:
                record = cls(*_created(folder, meta, on_failure))
            except (OSError, sqlite3.Error) as error:
                why = _explain(error, folder)
                raise InputError(f"{folder}: no run can be written there: {why}") from error
            on_failure.pop_all()
        return record

    @classmethod
    def open(cls, folder: Path, *, claim: bool = False) -> Record:
        """Open the record of an earlier run; `InputError` if it is missing, damaged or foreign.

        `claim`: lock the folder against a second scan, before anything is read and until the record
        is closed; `InputError` names the process that holds the lock.
        """
        require_support(folder)
        path = folder / FILE_NAME
        if not path.is_file():
            raise InputError(f"{folder}: {no_record_text(folder, FILE_NAME)}")
        with ExitStack() as on_failure:
            lock = on_failure.enter_context(FolderLock(folder)) if claim else None
            check_files(folder, FILE_NAME)
            try:
                record = on_failure.enter_context(cls(connect(path), folder, lock))
                record._version = check_schema(record._db, path)
                record._damaged = check_values(record._db, path, record._version)
            except (sqlite3.Error, UnicodeDecodeError) as error:  # names and texts of any bytes
                raise _refusal(error, path) from error
            on_failure.pop_all()
        return record

    @contextmanager
    def claimed(self) -> Iterator[None]:
        """Hold the lock against a second scan into this run; it ends with the process.

        Raises `InputError` that names the process which holds it.
        """
        lock, self._lock = self._lock or FolderLock(self.folder), None
        with lock:
            yield

    def close(self) -> None:
        """Close the file and release the lock; may be called twice."""
        if self.writing.end():
            self._db.close()
        if self._lock is not None:
            self._lock.close()

    def current_folder(self) -> Path | None:
        """Return the folder that holds the record's file now, even if moved; None if removed."""
        found = path_of(self._file)
        return found.parent if found is not None and found.is_file() else None

    def version(self) -> int:
        """Return a number that changes once somebody else has changed the record."""
        (number,) = self._db.execute("PRAGMA data_version").fetchone()
        return int(number)

    def rows(self) -> Rows:
        """Return readings, checks and events of one moment, whatever is written meanwhile."""
        self.writing.wait()
        self._db.execute("BEGIN")
        try:
            return Rows(self.readings(), self.checks(), list(self.events()))
        finally:
            self._db.rollback()

    def meta(self, key: str) -> str | None:
        """Return one entry of the run's description, None if there is none."""
        return {str(k): str(v) for k, v in self._rows("meta")}.get(key)

    def set_meta(self, key: str, value: str) -> None:
        """Set one entry of the run's description."""
        self._write({"meta": [(key, value)]}, replace=True)

    def add_device(self, role: str, identity: str) -> None:
        """Store the identity that a device gave; `role` is its place on the rig."""
        self._write({"device": [(role, identity)]}, replace=True)

    def add_settings(self, time_utc: str, role: str, settings: Mapping[str, str]) -> None:
        """Store a device's settings by name, units in the names."""
        rows = [(None, time_utc, role, *setting) for setting in settings.items()]
        self._write({"setting": rows})

    def add_event(self, time_utc: str, kind: str, text: str) -> None:
        """Store an event; `kind` is one of `event_kinds`."""
        self._write({"event": [(None, time_utc, kind, text)]})

    def add_dark(
        self, time_utc: str, exposure_s: float, frames: int, mean_dn: float, noise_dn: float
    ) -> None:
        """Store a dark measurement: mean count and temporal noise of one pixel, in DN."""
        self._write({"dark": [(None, time_utc, exposure_s, frames, mean_dn, noise_dn)]})

    def add_reading(
        self,
        reading: Reading,
        preview: Preview | None = None,
        frames: Sequence[Frame] = (),
        files: Sequence[str] = (),
    ) -> None:
        """Accept a measured geometry in one transaction, with its preview and its frames.

        A frame's row holds its exposure, the time of read-out, the camera's own time stamp, and the
        name in `files`, relative to the run's folder, if the frame itself is kept.
        """
        names: Sequence[str | None] = files or [None] * len(frames)
        step, again = reading.step, reading.step in self._replaceable
        pairs = enumerate(zip(frames, names, strict=True))
        rows = [(step, n, f.exposure_s, f.time_s, f.device_time_s, name) for n, (f, name) in pairs]
        tables: dict[str, _NewRows] = {"frame": rows, "reading": [astuple(reading)]}
        if preview is not None:
            row = (preview.step, preview.caption, preview.png, json.dumps(preview.polygon))
            tables["preview"] = [row]
        self._write(tables, replace=again)

    def allow_replacing(self, steps: Container[int]) -> None:
        """Let `add_reading` replace the readings of these steps; all others stay as accepted."""
        self._replaceable = steps

    def add_check(self, check: Check) -> None:
        """Store a check made at a resume, or one that ended the scan."""
        head = (check.before_step, check.expected, check.u_expected, check.jumped)
        self._write({"drift_at_resume": [(*head, *astuple(check.reading))]})

    def damaged(self) -> tuple[str, ...]:
        """Return the rows that were damaged since they were written: `reading 5`, `event 2`."""
        return tuple(f"{table} {row}" for table, rows in self._damaged.items() for row in rows)

    def remove_damaged(self) -> None:
        """Remove the damaged rows, and what belongs to a reading that is no longer there."""
        self.writing.run(self._delete_damaged)
        self._damaged = {}

    def _delete_damaged(self) -> None:
        with self._transaction() as database:
            for table, rows in self._damaged.items():
                database.executemany(f"DELETE FROM {table} WHERE rowid = ?", [(r,) for r in rows])
            for table in ("frame", "preview"):
                orphans = "step NOT IN (SELECT step FROM reading)"
                database.execute(f"DELETE FROM {table} NOT INDEXED WHERE {orphans}")
            database.execute("REINDEX")

    def readings(self) -> list[Reading]:
        """Return all measured geometries in the plan's order."""
        return [_reading(row) for row in self._rows("reading", "step")]

    def checks(self) -> list[Check]:
        """Return the drift checks made at each resume and those that ended the scan, in order."""
        return [
            Check(
                before_step=before_step,
                expected=expected,
                u_expected=u_expected,
                jumped=bool(jumped),
                reading=_reading(row),
            )
            for before_step, expected, u_expected, jumped, *row in self._rows("drift_at_resume")
        ]

    def settings(self) -> dict[str, dict[str, str]]:
        """Return the last settings of each device, by role and name."""
        found: dict[str, dict[str, str]] = {}
        for _, _, role, name, value in self._rows("setting"):
            found.setdefault(role, {})[name] = value
        return found

    def frame_files(self) -> list[str]:
        """Return the files of all kept frames, relative to the run's folder."""
        rows = self._rows("frame", "step, number")
        return [str(name) for *_, name in rows if name is not None]

    def previews(self) -> list[Preview]:
        """Return all previews in the plan's order."""
        rows = self._rows("preview", "step")
        return [Preview(step, text, png, json.loads(outline)) for step, text, png, outline in rows]

    def devices(self) -> dict[str, str]:
        """Return the identity of every device, by role."""
        return dict(self._rows("device", "role"))

    def darks(self) -> list[tuple[float, int, float, float]]:
        """Return exposure (s), frames, mean and noise (DN) of every dark, by exposure."""
        return [row[2:] for row in self._rows("dark", "exposure_s, id")]

    def events(self) -> Iterator[tuple[str, str, str]]:
        """Yield time, kind and text of every event, in order."""
        yield from (row[1:] for row in self._rows("event"))

    def _rows(self, table: str, order: str = "rowid") -> Iterator[tuple[Any, ...]]:
        """Yield the undamaged rows of a table, read from it and not from an index."""
        self.writing.wait()
        left_out = ", ".join(map(str, self._damaged.get(table, ())))
        yield from self._db.execute(
            f"SELECT {', '.join(self._names(table))} FROM {table} NOT INDEXED "
            f"WHERE rowid NOT IN ({left_out}) ORDER BY {order}"
        )

    def _names(self, table: str) -> list[str]:
        """Return the columns of a table in the record's version, its seal apart."""
        return [column.name for column in tables_of(self._version)[table]]

    def _write(self, tables: Mapping[str, _NewRows], *, replace: bool = False) -> None:
        """Insert rows into tables in one transaction."""

        def write() -> None:
            with self._transaction():
                for table, rows in tables.items():
                    self._insert(table, rows, replace=replace)

        self.writing.run(write)

    def _insert(self, table: str, rows: _NewRows, *, replace: bool) -> None:
        """Insert rows in the transaction that is open, sealed if the record's version has seals."""
        seals = has_seals(self._version)
        count = len(self._names(table))
        marks = ", ".join("?" * (count + seals))
        texts = [storable(row[:count]) for row in rows]
        whole = [sealed(table, row, self._version) if seals else row for row in texts]
        sql = f"INSERT{' OR REPLACE' * replace} INTO {table} VALUES ({marks})"
        self._db.executemany(sql, whole)

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        """One transaction; `StorageError` if the disk does not accept it, or it is not free."""
        self._require_same_files()
        path = self.folder / FILE_NAME
        try:
            with self._db:
                begin_writing(self._db, path)
                yield self._db
        except sqlite3.IntegrityError:
            raise  # an error of the program, not of the disk
        except sqlite3.Error as error:
            raise StorageError(f"{path}: {_explain(error, self.folder)}") from error

    def _require_same_files(self) -> None:
        """Raise `StorageError` if a file was moved, removed or cut: later rows would be lost."""
        path = self.folder / FILE_NAME
        try:
            same = samestat(path.stat(), self._file)
        except OSError:
            same = False
        if not same:
            raise StorageError(f"{path}: {absence_text(path_of(self._file))}")
        loss = self._side_files.loss()
        if loss:
            whole = self._side_files.save(self._db)
            raise StorageError(f"{loss} while the scan ran: {_SAVED if whole else _LOST}")


def _begin(database: sqlite3.Connection, meta: Mapping[str, str]) -> None:
    """Create all tables and the run's description in one transaction: a whole record or none."""
    database.execute("BEGIN")
    with database:
        create_tables(database)
        for row in {"schema_version": str(SCHEMA_VERSION), **meta}.items():
            database.execute("INSERT INTO meta VALUES (?, ?, ?)", sealed("meta", storable(row)))


def _refusal(error: Exception, path: Path) -> GonioError:
    """Return the error for a file that cannot be opened as a record."""
    if isinstance(error, sqlite3.Error) and is_busy(error):
        return StorageError(held_by_another(path))
    if isinstance(error, sqlite3.Error) and _name_of(error).startswith(_NOT_PERMITTED):
        return StorageError(f"{path}: {_explain(error, path.parent)}")
    return InputError(f"{path}: not a record of this program: {error}")


def _created(
    folder: Path, meta: Mapping[str, str], on_failure: ExitStack
) -> tuple[sqlite3.Connection, Path, FolderLock]:
    """Make a record's file, and return what a `Record` is made of.

    What has been made is removed by `on_failure`, under the lock.
    """
    path, made = folder / FILE_NAME, not folder.exists()
    if not (made or folder.is_dir()):
        raise InputError(f"{folder}: {_TAKEN}")
    make_folder(folder)
    lock = on_failure.enter_context(FolderLock(folder))
    if any(folder.iterdir()):
        raise InputError(f"{folder}: {_TAKEN}")
    if made:
        on_failure.callback(_remove_empty, folder)
    on_failure.callback(remove_database, path, create_file(path))
    database = connect(path)
    on_failure.callback(database.close)
    _begin(database, meta)
    sync_folder(folder)
    return database, folder, lock


def _remove_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()


def _name_of(error: sqlite3.Error) -> str:
    return str(getattr(error, "sqlite_errorname", ""))


def _explain(error: OSError | sqlite3.Error, folder: Path) -> str:
    """Return an error of the disk or of SQLite in words, with advice."""
    if isinstance(error, OSError):
        return explain_os_error(error, folder)
    name = _name_of(error)
    if name == "SQLITE_FULL":
        return disk_full(folder)
    if name.startswith(_NOT_PERMITTED):
        return f"cannot be written ({error}): look at the folder's permissions and its disk"
    return f"cannot be written ({error}): look at the disk"


def _reading(row: Iterable[Any]) -> Reading:
    """Return a row as a reading; SQLite stores NaN as NULL, and older rows are shorter."""
    values: list[Any] = [math.nan if value is None else value for value in row]
    return Reading(**dict(zip(_READING, values, strict=False)))
