"""Records in the schemas of earlier versions of the program, and seals computed anew."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from instrument.record.older_versions import OLDER_SQL
from instrument.record.record import FILE_NAME
from instrument.record.schema import TABLES
from instrument.record.seal import sealed


def as_version(run: Path, version: int) -> None:
    """Rewrite the record of a run with the tables of an older schema version, rows as they are."""
    new, old = run / FILE_NAME, run / "new.sqlite"
    new.rename(old)
    with closing(sqlite3.connect(new, isolation_level=None)) as database:
        database.executescript(OLDER_SQL[version])
        database.execute("ATTACH ? AS new", (str(old),))
        for table, columns in TABLES.items():
            names = ", ".join(column.name for column in columns)
            database.execute(f"INSERT INTO main.{table} SELECT {names} FROM new.{table}")
        database.execute("UPDATE meta SET value = ? WHERE key = 'schema_version'", (str(version),))
    for name in ("new.sqlite", "new.sqlite-wal", "new.sqlite-shm"):
        (run / name).unlink(missing_ok=True)


def seal_again(database: sqlite3.Connection) -> None:
    """Seal all rows of a record as they are now, as a forger would; no matter which rules."""
    tables = "SELECT name FROM pragma_table_list WHERE type = 'table' AND name = ?"
    column = "SELECT 1 FROM pragma_table_info(?) WHERE name = 'crc32'"
    for table in TABLES:
        found = database.execute(tables, (table,)).fetchone()
        if found and database.execute(column, (table,)).fetchone():
            _seal_table(database, table)


def _seal_table(database: sqlite3.Connection, table: str) -> None:
    names = ", ".join(column.name for column in TABLES[table])
    database.text_factory = bytes  # a forged text may be no UTF-8
    rows = database.execute(f"SELECT rowid, {names} FROM {table} NOT INDEXED").fetchall()
    database.text_factory = str
    seals = [(sealed(table, values)[-1], rowid) for rowid, *values in rows]
    database.executemany(f"UPDATE {table} SET crc32 = ? WHERE rowid = ?", seals)
