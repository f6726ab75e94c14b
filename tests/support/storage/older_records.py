"""Records in the schemas of earlier versions of the program."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from instrument.record.older_versions import OLDER_SQL
from instrument.record.record import FILE_NAME


def as_version_3(run: Path) -> None:
    """Rewrite the record of a run with the tables of schema version 3, all rows as they are."""
    new, old = run / FILE_NAME, run / "new.sqlite"
    new.rename(old)
    with closing(sqlite3.connect(new, isolation_level=None)) as database:
        database.executescript(OLDER_SQL[3])
        database.execute("ATTACH ? AS new", (str(old),))
        tables = database.execute("SELECT name FROM sqlite_schema WHERE type = 'table'").fetchall()
        for (table,) in tables:
            database.execute(f"INSERT INTO main.{table} SELECT * FROM new.{table}")
        database.execute("UPDATE meta SET value = '3' WHERE key = 'schema_version'")
    for name in ("new.sqlite", "new.sqlite-wal", "new.sqlite-shm"):
        (run / name).unlink(missing_ok=True)
