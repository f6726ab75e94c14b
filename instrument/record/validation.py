"""Checks of a record before it is trusted: it may come from anybody, with any contents.

They cover the files, before SQLite opens them; the schema, which must be exactly that of a version
of this program, since a view or a trigger would run code; and every value. The rules for values are
part of the schema: `PRAGMA quick_check` verifies them where the tables have them, and queries here
do so in older records. No schema can express the rules across rows, those for the outlines of
previews, for choices of steps and for the encoding of texts; they are checked here, too. A row that
is not as it was sealed is damaged: the record opens without it, unless nothing can replace it.
"""

from __future__ import annotations

import json
import math
import re
import sqlite3
import stat
from collections.abc import Iterator
from contextlib import closing
from functools import cache
from itertools import chain
from pathlib import Path

from instrument.errors import InputError
from instrument.record.event_kinds import CHOSEN
from instrument.record.older_versions import OLDER_SQL
from instrument.record.reading import Batch
from instrument.record.schema import (
    FIRST_STRICT,
    SCHEMA_VERSION,
    SQL,
    TABLES,
    has_seals,
    tables_of,
)
from instrument.record.seal import Damaged, damaged_rows

MOST_READINGS = 2_000_000
MOST_WORK = 100_000_000  # points times (blocks + resumes): reduction visits each pair
_MOST_PREVIEW_BYTES = 512 * 1024**2  # of all previews together: the report holds them in memory
_LARGEST_PIXEL = 1e30
_KNOWN_SQL = {**OLDER_SQL, SCHEMA_VERSION: SQL}

_NOT_BEGUN = (
    "stopped before the record had begun, so nothing was measured: remove the folder and run again"
)
_IRREPLACEABLE = ("meta", "drift_at_resume")
_OF_A_VALUE = re.compile(r"(CHECK constraint failed|\S+ value) in \w")  # words of quick_check
_ADVICE = "take an undamaged copy of the run"


def check_files(folder: Path, record: str, *others: str) -> None:
    """Refuse links, devices and pipes unopened: SQLite would change the file that a link names.

    `record` is the database's name; a rollback journal beside it, which this program needs only
    before a record has begun, could make SQLite delete any file. `others` are further files that
    are written to. Raises `InputError`.
    """
    for name in (record, f"{record}-wal", f"{record}-shm", *others):
        path = folder / name
        if path.is_symlink() or (path.exists() and not stat.S_ISREG(path.stat().st_mode)):
            raise InputError(f"{path}: is a link or no file; allowed: a regular file: {_ADVICE}")
    path = folder / record
    if _header(path)[18:] > b"\2":  # write version of the file format
        raise InputError(f"{path}: not a record of this program: its header forbids writing")
    journal = folder / f"{record}-journal"
    if journal.is_symlink() or journal.exists():
        raise InputError(f"{journal}: {_NOT_BEGUN}; else it is no run of this program: {_ADVICE}")


def _header(path: Path) -> bytes:
    """Return the first 19 bytes of a file; nothing if it cannot be read, which SQLite will say."""
    try:
        with path.open("rb") as file:
            return file.read(19)
    except OSError:
        return b""


def check_schema(database: sqlite3.Connection, path: Path) -> int:
    """Return the schema version of a record whose tables are exactly those of that version.

    Raises `InputError` for anything else, and `sqlite3.Error` if the file cannot be read.
    """
    found = _schema(database)
    if not found:
        raise InputError(f"{path.parent}: {_NOT_BEGUN}")
    _refuse_code(found, path)
    row = database.execute(
        "SELECT value FROM meta NOT INDEXED WHERE key = 'schema_version'"
    ).fetchone()
    version = {str(number): number for number in _KNOWN_SQL}.get(row and row[0])
    if version is None:
        raise InputError(
            f"{path}: schema version {row and str(row[0])[:40]}; this program reads "
            f"{', '.join(map(str, _KNOWN_SQL))}: use the version of the program that made the "
            "run"
        )
    _compare(found, version, path)
    return version


@cache
def _known_schema(version: int) -> dict[str, tuple[str, object]]:
    """Return what a record of that version holds, as `_schema` does."""
    with closing(sqlite3.connect(":memory:")) as model:
        model.executescript(_KNOWN_SQL[version])
        return _schema(model)


def _compare(found: dict[str, tuple[str, object]], version: int, path: Path) -> None:
    wanted = _known_schema(version)
    for name in [n for n in found if n not in wanted or found[n] != wanted[n]]:
        kind, _ = found[name]
        raise InputError(
            f"{path}: holds the {kind} {name[:40]!r}, which this program did not create so: "
            f"{_ADVICE}"
        )
    missing = [name for name in wanted if name not in found]
    if missing:
        raise InputError(f"{path}: has no {missing[0]!r}: not a whole record: {_ADVICE}")


def _refuse_code(found: dict[str, tuple[str, object]], path: Path) -> None:
    """Refuse views, triggers and virtual tables, which run code when a table is only read."""
    for name, (kind, sql) in found.items():
        if kind not in ("table", "index") or "VIRTUAL" in str(sql).upper()[:40]:
            raise InputError(
                f"{path}: holds the {kind} {name[:40]!r}, which no record of this program has: "
                f"{_ADVICE}"
            )


def _schema(database: sqlite3.Connection) -> dict[str, tuple[str, object]]:
    """Return kind and SQL of everything in a database by name, except what SQLite itself adds."""
    rows = database.execute("SELECT type, name, sql FROM sqlite_schema").fetchall()
    return {
        str(name): (str(kind), sql)
        for kind, name, sql in rows
        if not (sql is None and str(name).startswith("sqlite_autoindex_"))
        and not (kind == "table" and str(name).startswith("sqlite_stat"))
    }


def check_values(database: sqlite3.Connection, path: Path, version: int) -> Damaged:
    """Return the damaged rows of a record whose schema has been checked; refuse other faults.

    Those are values that no scan can have written, and a damaged row of the run's description or of
    a drift check at a resume: no later measurement replaces it. Raises `InputError`, and
    `sqlite3.Error` if the file is damaged.
    """
    faults = [str(text) for (text,) in database.execute("PRAGMA quick_check") if text != "ok"]
    structure = [text for text in faults if not _OF_A_VALUE.match(text)]
    sealed = has_seals(version) and not structure
    damaged = damaged_rows(database, version) if sealed else {}
    enforced = version >= FIRST_STRICT and not faults
    problems = chain(
        () if enforced else _wrong_values(database, damaged, version),
        () if damaged else (f"is damaged ({text[:200]})" for text in structure or faults),
        _without_replacement(damaged),
        _too_many(database, damaged),
        _wrong_previews(database, damaged),
        _wrong_choices(database, damaged),
    )
    for text in problems:
        raise InputError(f"{path}: {text}: {_ADVICE}")
    _decode_texts(database, damaged)
    return damaged


def _without_replacement(damaged: Damaged) -> Iterator[str]:
    for table in _IRREPLACEABLE:
        for row in damaged.get(table, ()):
            yield f"{table}, row {row}: damaged since it was written, and nothing can replace it"


def _sound(table: str, damaged: Damaged) -> str:
    """Return SQL for a table and the condition that a row is not damaged."""
    return f"{table} NOT INDEXED WHERE rowid NOT IN ({', '.join(map(str, damaged.get(table, ())))})"


def _wrong_values(database: sqlite3.Connection, damaged: Damaged, version: int) -> Iterator[str]:
    """Yield the first value of each column that breaks the column's rule."""
    for table, columns in tables_of(version).items():
        key = _short(columns[0].name)
        for column in columns:
            wrong = f"{_sound(table, damaged)} AND NOT {column.full_condition()} LIMIT 1"
            for row, value in database.execute(f"SELECT {key}, {_short(column.name)} FROM {wrong}"):
                yield f"{table} {row!r}: {column.name} is {value!r}; allowed: {column.allowed}"


def _short(column: str) -> str:
    """Return SQL for a column's value, of a text or bytes only the beginning."""
    beginning = f"substr({column}, 1, 40)"
    return f"CASE WHEN typeof({column}) IN ('text', 'blob') THEN {beginning} ELSE {column} END"


def _too_many(database: sqlite3.Connection, damaged: Damaged) -> Iterator[str]:
    counts = "SELECT COUNT(*), SUM(kind = 'point'), COUNT(DISTINCT block) FROM reading"
    total, points, blocks = database.execute(counts).fetchone()
    (resumes,) = database.execute("SELECT COUNT(*) FROM drift_at_resume").fetchone()
    if total > MOST_READINGS or (points or 0) * (blocks + resumes) > MOST_WORK:
        yield f"{total} readings, in {blocks} blocks and with {resumes} resumes, are too many"
    drifts = f"{_sound('reading', damaged)} AND kind = 'drift'"
    twice = f"FROM {drifts} GROUP BY block, time_s HAVING COUNT(*) > 1 LIMIT 1"
    for step, time_s in database.execute(f"SELECT MAX(step), time_s {twice}"):
        yield f"reading {step!r}: a second drift check at {time_s!r} s; allowed: one at a time"


def _wrong_previews(database: sqlite3.Connection, damaged: Damaged) -> Iterator[str]:
    sound = _sound("preview", damaged)
    (size,) = database.execute("SELECT TOTAL(length(png)) FROM preview").fetchone()
    if size > _MOST_PREVIEW_BYTES:
        yield f"pictures of {size:.0f} bytes; allowed: {_MOST_PREVIEW_BYTES}"
    for step, outline in database.execute(f"SELECT step, polygon FROM {sound}"):
        if not _is_outline(outline):
            yield f"preview {step!r}: has no outline that can be read; allowed: JSON [[x, y], ...]"


def _wrong_choices(database: sqlite3.Connection, damaged: Damaged) -> Iterator[str]:
    """Yield what is wrong with the choices of a scan: their form, their order, a step twice."""
    own = f"{_sound('event', damaged)} AND kind = ? ORDER BY rowid"
    last, taken = -1, set[int]()
    for row, text in database.execute(f"SELECT id, text FROM {own}", (CHOSEN,)):
        try:
            batch = Batch.of_text(text)
        except ValueError as error:
            yield f"event {row!r}: is no choice of steps: {str(error)[:200]}"
            return
        if batch.number <= last:
            yield f"event {row!r}: batch {batch.number} after {last}; allowed: rising numbers"
        if taken.intersection(batch.steps):
            twice = min(taken.intersection(batch.steps))
            yield f"event {row!r}: step {twice} is chosen twice; allowed: once"
        last = batch.number
        taken.update(batch.steps)


def _is_outline(text: str) -> bool:
    """Return True for JSON of pairs of finite numbers."""
    try:
        corners = json.loads(text)
        return isinstance(corners, list) and all(
            len(corner) == 2 and all(_is_finite(value) for value in corner) for corner in corners
        )
    except (ValueError, TypeError, RecursionError):
        return False


def _is_finite(value: object) -> bool:
    return isinstance(value, float | int) and abs(value) < _LARGEST_PIXEL and math.isfinite(value)


def _decode_texts(database: sqlite3.Connection, damaged: Damaged) -> None:
    """Read every text once that need not be ASCII: bytes that are no UTF-8 raise `sqlite3.Error`.

    No rule of the schema can express it.
    """
    for table in ("meta", "device", "setting", "event", "preview"):
        texts = [column.name for column in TABLES[table] if column.sql_type == "TEXT"]
        for _ in database.execute(f"SELECT {', '.join(texts)} FROM {_sound(table, damaged)}"):
            pass
