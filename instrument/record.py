"""The run record: one SQLite file a run, where acquiring and analysing meet.

Write-ahead log and `synchronous=FULL`: what has been committed survives the process. Any SQLite
tool can read it while the scan runs. Counts (DN) are stored as measured; radiance and BRDF are
worked out from them afterwards, so nothing that a value came from is lost.
"""

from __future__ import annotations

import fcntl
import json
import math
import os
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any, Literal

from instrument.closing import Closing
from instrument.devices import Frame, Surface
from instrument.errors import InputError
from instrument.mounts import network_share

SCHEMA_VERSION = 2
FILE_NAME = "record.sqlite"
LOCK_NAME = ".scanning"

Kind = Literal["point", "tile", "drift"]

_TABLES = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE device (role TEXT PRIMARY KEY, identity TEXT NOT NULL);
CREATE TABLE event (id INTEGER PRIMARY KEY, time_utc TEXT NOT NULL, kind TEXT NOT NULL,
                    text TEXT NOT NULL);
CREATE TABLE dark (id INTEGER PRIMARY KEY, time_utc TEXT NOT NULL, exposure_s REAL NOT NULL,
                   frames INTEGER NOT NULL, mean_dn REAL NOT NULL, noise_dn REAL NOT NULL);
CREATE TABLE frame (step INTEGER NOT NULL, number INTEGER NOT NULL, exposure_s REAL NOT NULL,
                    time_s REAL NOT NULL, device_time_s REAL, PRIMARY KEY (step, number));
CREATE TABLE preview (step INTEGER PRIMARY KEY, caption TEXT NOT NULL, png BLOB NOT NULL,
                      polygon TEXT NOT NULL);
"""


@dataclass(frozen=True, slots=True)
class Reading:
    """One measured geometry, in counts: the mean of the window, its uncertainties, its flags.

    `step` is its number in the plan. Angles in degrees, theta_r signed. `signal_dn` is the
    area-weighted mean of the window over all frames less the dark, cos^4 divided out; the u are
    standard uncertainties of it: `u_noise_dn` of photons and read-out, `u_quantisation_dn` of
    rounding the frames to whole counts, `u_dark_dn` of the dark (the same for all readings
    of one exposure), `u_placement_dn` of how well the sample stands on the axis (signed:
    one placement shifts all its readings together) and `u_texture_dn` of what that leaves out.
    `lamp_setting` numbers the places of the lamp, `block` the times it was set by hand.
    """

    step: int
    kind: Kind
    surface: Surface
    theta_i_deg: float
    dphi_deg: float
    theta_r_deg: float
    lamp_setting: int
    block: int
    signal_dn: float
    u_noise_dn: float
    u_quantisation_dn: float
    u_dark_dn: float
    u_placement_dn: float
    u_texture_dn: float
    exposure_s: float
    frames: int
    window_pixels: float
    saturated_pixels: int
    peak_dn: float
    time_s: float
    time_utc: str
    flags: str


@dataclass(frozen=True, slots=True)
class Preview:
    """A small picture for the report with the window's outline, (N, 2) as (column, row)."""

    step: int
    caption: str
    png: bytes
    polygon: list[list[float]]


_SQL_TYPE = {"int": "INTEGER", "float": "REAL"}
_READING_COLUMNS = ", ".join(
    f"{f.name} {_SQL_TYPE.get(str(f.type), 'TEXT')}"
    + (" PRIMARY KEY" if f.name == "step" else "" if f.type == "float" else " NOT NULL")
    for f in fields(Reading)
)


class Record(Closing):
    """An open record; use it with `with`. Every `add_` is on disk when it returns."""

    def __init__(self, connection: sqlite3.Connection, folder: Path) -> None:
        self._db = connection
        self.folder = folder

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
            folder.mkdir(parents=True, exist_ok=True)
            database = _connect(folder / FILE_NAME)
        except (OSError, sqlite3.Error) as error:
            raise InputError(f"{folder}: cannot write the run there: {error}") from error
        with database:
            database.executescript(_TABLES + f"CREATE TABLE reading ({_READING_COLUMNS});")
            rows = {"schema_version": str(SCHEMA_VERSION), **meta}
            database.executemany("INSERT INTO meta VALUES (?, ?)", rows.items())
        return cls(database, folder)

    @classmethod
    def open(cls, folder: Path) -> Record:
        """Open the record of an earlier run; `InputError` when there is none or it is foreign."""
        _refuse_network_share(folder)
        path = folder / FILE_NAME
        if not path.is_file():
            raise InputError(f"{folder}: no {FILE_NAME} there: name the folder of a run")
        try:
            record = cls(_connect(path), folder)
            version = record.meta("schema_version")
        except sqlite3.Error as error:
            raise InputError(f"{path}: not a record of this program: {error}") from error
        if version != str(SCHEMA_VERSION):
            raise InputError(
                f"{path}: schema version {version}; this program reads {SCHEMA_VERSION}: "
                "use the version of the program that made the run"
            )
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

    def meta(self, key: str) -> str | None:
        """One entry of the run's description."""
        row = self._db.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
        return None if row is None else str(row[0])

    def set_meta(self, key: str, value: str) -> None:
        """Set one entry of the run's description."""
        with self._db:
            self._db.execute("INSERT OR REPLACE INTO meta VALUES (?, ?)", (key, value))

    def add_device(self, role: str, identity: str) -> None:
        """Write down which device answered."""
        with self._db:
            self._db.execute("INSERT OR REPLACE INTO device VALUES (?, ?)", (role, identity))

    def add_event(self, time_utc: str, kind: str, text: str) -> None:
        """Write down what happened: a prompt and its answer, a stop, a fault, the end."""
        with self._db:
            self._db.execute("INSERT INTO event VALUES (NULL, ?, ?, ?)", (time_utc, kind, text))

    def add_dark(
        self, time_utc: str, exposure_s: float, frames: int, mean_dn: float, noise_dn: float
    ) -> None:
        """Write down a dark: mean count and temporal noise of one pixel."""
        row = (time_utc, exposure_s, frames, mean_dn, noise_dn)
        with self._db:
            self._db.execute("INSERT INTO dark VALUES (NULL, ?, ?, ?, ?, ?)", row)

    def add_reading(
        self, reading: Reading, preview: Preview | None = None, frames: Sequence[Frame] = ()
    ) -> None:
        """Accept a measured geometry in one transaction: its picture if one is kept, its frames.

        Of a frame are kept its exposure, when it was read, and the camera's own time stamp.
        """
        marks = ", ".join("?" * len(fields(Reading)))
        rows = [
            (reading.step, number, frame.exposure_s, frame.time_s, frame.device_time_s)
            for number, frame in enumerate(frames)
        ]
        with self._db:
            self._db.executemany("INSERT INTO frame VALUES (?, ?, ?, ?, ?)", rows)
            self._db.execute(f"INSERT INTO reading VALUES ({marks})", astuple(reading))
            if preview is not None:
                row = (preview.step, preview.caption, preview.png, json.dumps(preview.polygon))
                self._db.execute("INSERT INTO preview VALUES (?, ?, ?, ?)", row)

    def readings(self) -> list[Reading]:
        """All measured geometries in the plan's order."""
        rows = self._db.execute("SELECT * FROM reading ORDER BY step").fetchall()
        return [Reading(*_with_nan(row)) for row in rows]

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


def _connect(path: Path) -> sqlite3.Connection:
    database = sqlite3.connect(path)
    try:
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("PRAGMA synchronous=FULL")
    except sqlite3.Error:
        database.close()
        raise
    return database
