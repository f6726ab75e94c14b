"""The record's tables, and how its file is opened and begun."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import get_args

from instrument.devices import Surface
from instrument.record.reading import Kind, Reading
from instrument.record.validation import harden_connection

SCHEMA_VERSION = 3

_TABLES = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE device (role TEXT PRIMARY KEY, identity TEXT NOT NULL);
CREATE TABLE setting (id INTEGER PRIMARY KEY, time_utc TEXT NOT NULL, role TEXT NOT NULL,
                      name TEXT NOT NULL, value TEXT NOT NULL);
CREATE TABLE event (id INTEGER PRIMARY KEY, time_utc TEXT NOT NULL, kind TEXT NOT NULL,
                    text TEXT NOT NULL);
CREATE TABLE dark (id INTEGER PRIMARY KEY, time_utc TEXT NOT NULL, exposure_s REAL NOT NULL,
                   frames INTEGER NOT NULL, mean_dn REAL NOT NULL, noise_dn REAL NOT NULL);
CREATE TABLE frame (step INTEGER NOT NULL, number INTEGER NOT NULL, exposure_s REAL NOT NULL,
                    time_s REAL NOT NULL, device_time_s REAL, file TEXT,
                    PRIMARY KEY (step, number));
CREATE TABLE preview (step INTEGER PRIMARY KEY, caption TEXT NOT NULL, png BLOB NOT NULL,
                      polygon TEXT NOT NULL);
"""
_SQL_TYPE = {"int": "INTEGER", "float": "REAL"}
_COLUMNS = {f.name: _SQL_TYPE.get(str(f.type), "TEXT") for f in fields(Reading)}

MARKS = ", ".join("?" * len(_COLUMNS))
"""One `?` for each column of a reading."""


_WORDS: dict[str, tuple[str, ...]] = {"kind": get_args(Kind), "surface": get_args(Surface)}

KINDS = {f.name: _WORDS.get(f.name, str(f.type)) for f in fields(Reading)}
"""What each column of a reading may hold: `int`, `float`, `str`, or one of the words."""


def _reading_columns(key: str = "") -> str:
    """A reading as columns; a float may be unknown, and is NULL then."""
    rows = (
        f"{name} {kind}" + (" PRIMARY KEY" if name == key else " NOT NULL" * (kind != "REAL"))
        for name, kind in _COLUMNS.items()
    )
    return ", ".join(rows)


_READINGS = f"""
CREATE TABLE reading ({_reading_columns(key="step")});
CREATE TABLE drift_at_resume (before_step INTEGER NOT NULL, expected REAL NOT NULL,
                              u_expected REAL NOT NULL, jumped INTEGER NOT NULL,
                              {_reading_columns()});
"""

TABLES = _TABLES + _READINGS
"""The SQL that makes all of them."""


def connect(path: Path) -> sqlite3.Connection:
    """Open a file as a record: with a write-ahead log, each commit on disk when it returns."""
    database = sqlite3.connect(path)
    try:
        harden_connection(database)
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("PRAGMA synchronous=FULL")
    except sqlite3.Error:
        database.close()
        raise
    return database


def begin(database: sqlite3.Connection, meta: Mapping[str, str]) -> None:
    """All tables and the run's description in one transaction: a record is whole or none."""
    database.execute("BEGIN")
    with database:
        for statement in TABLES.split(";"):
            database.execute(statement)
        rows = {"schema_version": str(SCHEMA_VERSION), **meta}
        database.executemany("INSERT INTO meta VALUES (?, ?)", rows.items())
