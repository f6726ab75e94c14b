"""Seal of a row: CRC-32 of its values, by which a value that changed on the disk is detected.

SQLite finds damage to the structure of its file, but not to a value. The seal covers all columns
except a number that SQLite assigns. For text, in UTF-8, and bytes the CRC-32 of the bytes takes
their place; the seal is the CRC-32 of the list of values as Python writes it. A seal detects
accidents; anyone can compute one, so it does not prove where a record comes from.
"""

from __future__ import annotations

import math
import sqlite3
import zlib
from collections.abc import Sequence

from instrument.record.schema import ASSIGNED, SCHEMA_VERSION, SEAL, Column, tables_of

Damaged = dict[str, tuple[int, ...]]
"""SQLite's row numbers of the damaged rows, by table."""


def storable(row: Sequence[object]) -> tuple[object, ...]:
    """Return a row whose texts can be stored as UTF-8: the name of a file may be any bytes."""
    return tuple(
        v.encode("utf-8", "backslashreplace").decode() if isinstance(v, str) else v for v in row
    )


def sealed(table: str, row: Sequence[object], version: int = SCHEMA_VERSION) -> tuple[object, ...]:
    """Return a row with its seal, as it is inserted into a record of that schema version."""
    columns = tables_of(version)[table]
    stored = [_stored(c, v) for c, v in zip(columns, row, strict=True) if c is not ASSIGNED]
    return (*row, seal_of(stored))


def damaged_rows(database: sqlite3.Connection, version: int = SCHEMA_VERSION) -> Damaged:
    """Return the rows whose values are not those that were sealed; tables without one are absent.

    Values are read from the tables themselves, not from an index, which may be damaged as well.
    """
    texts, database.text_factory = database.text_factory, bytes  # damaged text may be no UTF-8
    try:
        tables = tables_of(version)
        found = {name: _damaged(database, name, columns) for name, columns in tables.items()}
    finally:
        database.text_factory = texts
    return {table: rows for table, rows in found.items() if rows}


def _damaged(
    database: sqlite3.Connection, table: str, columns: Sequence[Column]
) -> tuple[int, ...]:
    names = ", ".join(c.name for c in columns if c is not ASSIGNED)
    rows = database.execute(f"SELECT rowid, {SEAL.name}, {names} FROM {table} NOT INDEXED")
    return tuple(rowid for rowid, seal, *values in rows if seal != seal_of(values))


def seal_of(values: Sequence[object]) -> int:
    """Return the seal of a row (without what SQLite assigns) as it returns it, texts as bytes."""
    short = [zlib.crc32(v) if isinstance(v, bytes) else v for v in values]
    return zlib.crc32(repr(short).encode())


def _stored(column: Column, value: object) -> object:
    """Return a value as SQLite stores it: NaN as NULL, -0.0 as 0.0, a whole number in REAL."""
    if isinstance(value, str):
        return value.encode()
    if isinstance(value, float | int) and column.sql_type == "REAL":
        return None if math.isnan(value) else float(value) + 0.0
    return int(value) if isinstance(value, int) else value
