"""Records in the schemas of earlier versions of the program, and seals computed anew."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from instrument.record.older_versions import OLDER_SQL
from instrument.record.record import FILE_NAME
from instrument.record.schema import ASSIGNED, SCHEMA_VERSION, TABLES, has_seals, tables_of
from instrument.record.seal import seal_of, sealed


def as_version(run: Path, version: int) -> None:
    """Rewrite the record of a run with the tables of an older schema version, rows as they are."""
    new, old = run / FILE_NAME, run / "new.sqlite"
    new.rename(old)
    with closing(sqlite3.connect(new, isolation_level=None)) as database:
        database.executescript(OLDER_SQL[version])
        database.execute("ATTACH ? AS new", (str(old),))
        database.execute("BEGIN")  # else each row is a transaction of its own
        for table, columns in tables_of(version).items():
            names = ", ".join(column.name for column in columns)
            if has_seals(version):
                _copy_sealed(database, table, names, version)
            else:
                database.execute(f"INSERT INTO main.{table} SELECT {names} FROM new.{table}")
        _name_version(database, version)
        database.execute("COMMIT")
    for name in ("new.sqlite", "new.sqlite-wal", "new.sqlite-shm"):
        (run / name).unlink(missing_ok=True)


def _copy_sealed(database: sqlite3.Connection, table: str, names: str, version: int) -> None:
    rows = [
        sealed(table, row, version) for row in database.execute(f"SELECT {names} FROM new.{table}")
    ]
    for row in rows:
        database.execute(f"INSERT INTO main.{table} VALUES ({', '.join('?' * len(row))})", row)


def _name_version(database: sqlite3.Connection, version: int) -> None:
    row = ("schema_version", str(version))
    values = sealed("meta", row, version) if has_seals(version) else row
    marks = ", ".join("?" * len(values))
    database.execute(f"INSERT OR REPLACE INTO main.meta VALUES ({marks})", values)


def seal_again(database: sqlite3.Connection) -> None:
    """Seal all rows of a record as they are now, as a forger would; no matter which rules."""
    tables = "SELECT name FROM pragma_table_list WHERE type = 'table' AND name = ?"
    column = "SELECT 1 FROM pragma_table_info(?) WHERE name = 'crc32'"
    for table in TABLES:
        found = database.execute(tables, (table,)).fetchone()
        if found and database.execute(column, (table,)).fetchone():
            _seal_table(database, table)


def _seal_table(database: sqlite3.Connection, table: str) -> None:
    present = {row[1] for row in database.execute(f"PRAGMA table_info({table})")}
    version = next(
        v for v in (SCHEMA_VERSION, 7, 6, 5) if {c.name for c in tables_of(v)[table]} <= present
    )
    names = ", ".join(c.name for c in tables_of(version)[table] if c is not ASSIGNED)
    database.text_factory = bytes  # a forged text may be no UTF-8
    rows = database.execute(f"SELECT rowid, {names} FROM {table} NOT INDEXED").fetchall()
    database.text_factory = str
    seals = [(seal_of(values), rowid) for rowid, *values in rows]
    database.executemany(f"UPDATE {table} SET crc32 = ? WHERE rowid = ?", seals)
