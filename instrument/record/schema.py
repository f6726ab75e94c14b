"""Schema of the run record: its tables, the allowed values of each column, and the connection.

All tables are STRICT, and every rule is a CHECK whose name says what is allowed. SQLite refuses
other values when a row is written, and `PRAGMA quick_check` finds them in a file from elsewhere.
Each row ends in its seal, see `seal`, which shows whether a value changed since it was written. A
released schema never changes: a change here needs a new SCHEMA_VERSION, and the SQL of the old
version moves to `older_versions`.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple, get_args

from instrument.devices import Surface
from instrument.errors import InputError
from instrument.record.reading import Kind
from instrument.record.write_lock import TRY_S
from instrument.text.network_share import network_share

SCHEMA_VERSION = 8
FIRST_STRICT, _FIRST_SEALED = 4, 5  # schema versions
_FIRST_STRAY_LIGHT, _FIRST_FLIGHT, _FIRST_SCATTER = 6, 7, 8
MOST_BYTES = 128 * 1024**2  # of one text or picture; the largest camera's picture needs half of it
LEAST_SQLITE = (3, 37, 0)  # the first with STRICT tables
_OPENING_S = 2.0  # of waiting for a lock; nothing moves yet
_LARGEST = 1e30  # of any number that has no limit of its own
_LARGEST_WHOLE = 2**53  # larger whole numbers are not exact as floats


class Column(NamedTuple):
    """A column, the SQL condition on its values ("" for none), and that condition in words."""

    name: str
    sql_type: str
    condition: str
    allowed: str
    optional: bool = False

    def definition(self, *, primary_key: bool) -> str:
        """Return the column's definition in CREATE TABLE."""
        sql = f"{self.name} {self.sql_type}" + " NOT NULL" * (not self.optional)
        sql += " PRIMARY KEY" * primary_key
        if self.condition:
            sql += f' CONSTRAINT "{self.name}: {self.allowed}" CHECK ({self.condition})'
        return sql

    def full_condition(self) -> str:
        """Return the SQL condition for type and value, for a table that enforces neither."""
        sql = f"typeof({self.name}) = '{self.sql_type.lower()}'"
        sql += f" AND ({self.condition})" * bool(self.condition)
        return f"({self.name} IS NULL OR ({sql}))" if self.optional else f"({sql})"


def _number(
    name: str, low: float = -_LARGEST, high: float = _LARGEST, *, optional: bool = False
) -> Column:
    """Finite float; an optional one may be unknown: NaN, which SQLite stores as NULL."""
    condition = f"{name} BETWEEN {low!r} AND {high!r}"
    return Column(name, "REAL", condition, f"a number from {low:g} to {high:g}", optional)


def _integer(name: str, low: int = 0, high: int = _LARGEST_WHOLE) -> Column:
    condition = f"{name} BETWEEN {low} AND {high}"
    return Column(name, "INTEGER", condition, f"a whole number from {low} to {high}")


def _word(name: str, words: Iterable[str]) -> Column:
    condition = f"{name} IN ({', '.join(map(repr, words))})"
    return Column(name, "TEXT", condition, " or ".join(words))


def _plain(name: str, *, optional: bool = False) -> Column:
    """Text that reaches tables and terminals: no formula of a spreadsheet, no escape sequence."""
    condition = (
        f"length({name}) <= 1000 AND length({name}) = length(CAST({name} AS BLOB)) "
        f"AND {name} NOT GLOB '*[^ -~]*' AND {name} NOT GLOB '[=+@-]*'"
    )
    allowed = "plain words in ASCII, up to 1000 characters, not beginning with = + - @"
    return Column(name, "TEXT", condition, allowed, optional)


def _text(name: str) -> Column:
    return Column(name, "TEXT", "", "text in UTF-8")


ASSIGNED = Column("id", "INTEGER", "", "a whole number")
"""Number of a row, which SQLite assigns."""

SEAL = _integer("crc32", 0, 2**32 - 1)
"""Last column of each table; `TABLES` holds the others."""

_META_VALUE = Column(
    "value",
    "TEXT",
    "key NOT IN ('steps', 'hidden') OR (length(CAST(value AS BLOB)) BETWEEN 1 AND 9 "
    "AND length(value) = length(CAST(value AS BLOB)) AND value NOT GLOB '*[^0-9]*')",
    "a whole number of up to 9 digits for steps, hidden, else text in UTF-8",
)
_EXPOSURE_S = _number("exposure_s", 1e-9, 1e6)
_STRAY_LIGHT = (
    _number("patch_dn"),
    _number("u_patch_dn", 0.0),
    _number("near_window_dn"),
    _number("middle_window_dn"),
    _number("far_window_dn"),
    _number("near_patch_dn"),
    _number("middle_patch_dn"),
    _number("far_patch_dn"),
)
_FLIGHT = (
    _number("blur_deg", 0.0, 360.0),
    _number("u_turn_deg", 0.0, 360.0),
    _number("u_latency_deg", -360.0, 360.0),
)
_SCATTER = (
    _number("u_pixel_dn", 0.0, optional=True),
    _number("scatter_dn", 0.0, optional=True),
)
_READING = (
    _integer("step"),
    _word("kind", get_args(Kind)),
    _word("surface", get_args(Surface)),
    _number("theta_i_deg", 0.0, 89.5),
    _number("dphi_deg", -360.0, 360.0),
    _number("theta_r_deg", -89.5, 89.5),
    _integer("lamp_setting"),
    _integer("block"),
    _number("signal_dn", optional=True),
    _number("u_noise_dn", 0.0, optional=True),
    _number("u_quantisation_dn", 0.0, optional=True),
    _number("u_dark_dn", 0.0, optional=True),
    _number("u_placement_dn", optional=True),
    _number("u_texture_dn", 0.0, optional=True),
    _EXPOSURE_S,
    _integer("frames"),
    _number("window_pixels", optional=True),
    _integer("saturated_pixels"),
    _number("peak_dn", optional=True),
    _number("time_s", -1e9, 1e9),
    _number("free_s", optional=True),
    _plain("time_utc"),
    _plain("flags"),
    *_STRAY_LIGHT,
    *_FLIGHT,
    *_SCATTER,
)
TABLES: dict[str, tuple[Column, ...]] = {
    "meta": (_text("key"), _META_VALUE),
    "device": (_text("role"), _text("identity")),
    "setting": (ASSIGNED, _plain("time_utc"), _text("role"), _text("name"), _text("value")),
    "event": (ASSIGNED, _plain("time_utc"), _text("kind"), _text("text")),
    "dark": (
        ASSIGNED, _plain("time_utc"), _EXPOSURE_S, _integer("frames", 1), _number("mean_dn"),
        _number("noise_dn"),
    ),
    "frame": (
        _integer("step"), _integer("number"), _EXPOSURE_S, _number("time_s"),
        _number("device_time_s", optional=True), _plain("file", optional=True),
    ),
    "preview": (
        _integer("step"),
        _text("caption"),
        Column("png", "BLOB", f"length(png) <= {MOST_BYTES}", f"bytes, at most {MOST_BYTES}"),
        Column("polygon", "TEXT", "length(polygon) <= 10000", "JSON of up to 10000 characters"),
    ),
    "reading": _READING,
    "drift_at_resume": (
        _integer("before_step"), _number("expected"), _number("u_expected", 0.0),
        _integer("jumped", 0, 1), *_READING,
    ),
}  # fmt: skip
"""All tables with their columns; the first column identifies a row in messages."""


def tables_of(version: int) -> dict[str, tuple[Column, ...]]:
    """Return the tables of a schema version; the columns that came later are always the last."""
    groups = (
        (_FIRST_STRAY_LIGHT, _STRAY_LIGHT), (_FIRST_FLIGHT, _FLIGHT), (_FIRST_SCATTER, _SCATTER)
    )  # fmt: skip
    later = {column for first, columns in groups for column in columns if version < first}
    return {name: tuple(c for c in own if c not in later) for name, own in TABLES.items()}


def tables_sql(version: int) -> str:
    """Return the statements that make the tables of a version, each ending in a semicolon."""
    seal = (SEAL,) if has_seals(version) else ()
    return "".join(_create(name, (*own, *seal)) for name, own in tables_of(version).items())


def has_seals(version: int) -> bool:
    """Return True for a schema version whose rows are sealed."""
    return version >= _FIRST_SEALED


def _create(table: str, columns: tuple[Column, ...]) -> str:
    has_key = table not in ("frame", "drift_at_resume")
    rows = [c.definition(primary_key=has_key and c is columns[0]) for c in columns]
    rows += ["PRIMARY KEY (step, number)"] * (table == "frame")
    return f"CREATE TABLE {table} (\n  " + ",\n  ".join(rows) + "\n) STRICT;\n"


SQL = tables_sql(SCHEMA_VERSION)


def require_support(folder: Path) -> None:
    """Refuse a Python with an old SQLite, and a folder on a network share."""
    if sqlite3.sqlite_version_info < LEAST_SQLITE:
        raise InputError(
            f"{folder}: SQLite {sqlite3.sqlite_version} of this Python cannot hold a record; "
            f"needed: {'.'.join(map(str, LEAST_SQLITE))} or later: use another Python"
        )
    share = network_share(folder)
    if share is not None:
        raise InputError(
            f"{folder}: is on a network share ({share}), where the record is not safe: name a "
            "folder on a local disk, and copy the run afterwards"
        )


def harden_connection(database: sqlite3.Connection) -> None:
    """Keep SQLite from running code stored in the file and from loading huge values."""
    database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_BYTES)
    database.execute("PRAGMA trusted_schema=OFF")
    database.execute("PRAGMA cell_size_check=ON")


def connect(path: Path) -> sqlite3.Connection:
    """Open a file as a record: hardened, with a write-ahead log, each commit flushed to disk.

    Any thread may use it, one at a time.
    """
    database = sqlite3.connect(path, timeout=_OPENING_S, check_same_thread=False)
    try:
        harden_connection(database)
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("PRAGMA synchronous=FULL")
        database.execute(f"PRAGMA busy_timeout={1e3 * TRY_S:.0f}")
    except sqlite3.Error:
        database.close()
        raise
    return database


def create_tables(database: sqlite3.Connection) -> None:
    """Create all tables in the transaction that is open."""
    for statement in SQL.split(";"):
        database.execute(statement)
