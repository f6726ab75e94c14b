"""A record is believed only after a look at it: whoever sent it may have put anything in there.

Checked are the files before SQLite opens them, the tables, which must be those that this program
makes (a view or a trigger would run what stands in it), and every value that is read later.
"""

from __future__ import annotations

import json
import math
import sqlite3
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path

from instrument.errors import InputError
from instrument.text.terminal_safe import first_unfit

MOST_BYTES = 128 * 1024**2  # of one text or picture; that of the largest camera needs half of it
MOST_READINGS = 2_000_000
MOST_WORK = 100_000_000  # points times drift checks and blocks: each pair is looked at
_PICTURES = (512 * 1024**2, MOST_BYTES)  # all of them, as the report holds them all; one of them
_PICTURE_CORNERS = 10_000  # characters

# Of a reading; what is not here may be anything from -1e30 to 1e30.
_LIMITS = {
    "theta_i_deg": (0.0, 89.5),
    "theta_r_deg": (-89.5, 89.5),
    "dphi_deg": (-360.0, 360.0),
    "exposure_s": (1e-9, 1e6),
    "time_s": (-1e9, 1e9),
    "u_noise_dn": (0.0, 1e30),
    "u_quantisation_dn": (0.0, 1e30),
    "u_dark_dn": (0.0, 1e30),
    "u_texture_dn": (0.0, 1e30),
}
_ALWAYS_KNOWN = ("theta_i_deg", "theta_r_deg", "dphi_deg", "exposure_s", "time_s")
_HIGHEST = 1e30
_LARGEST_WHOLE = 2**53
NOT_BEGUN = (
    "stopped before the record had begun, so nothing was measured: remove the folder and run again"
)
_READINGS = ("reading", "drift_at_resume")  # the tables that hold some
_ADVICE = "take an undamaged copy of the run"


def check_files(folder: Path, record: str, *others: str) -> None:
    """Refuse, unopened, what is no file: a link would have others' files changed.

    `record` is the database's name; a rollback journal beside it, which this program needs only
    before a record has begun, could have any file deleted. `others` are further files that are
    written to. Raises `InputError`.
    """
    for name in (record, f"{record}-wal", f"{record}-shm", *others):
        path = folder / name
        if path.is_symlink() or (path.exists() and not stat.S_ISREG(path.stat().st_mode)):
            raise InputError(f"{path}: is a link or no file; allowed: a file of its own: {_ADVICE}")
    journal = folder / f"{record}-journal"
    if journal.is_symlink() or journal.exists():
        raise InputError(f"{journal}: {NOT_BEGUN}; else it is no run of this program: {_ADVICE}")


def harden_connection(database: sqlite3.Connection) -> None:
    """Have SQLite run nothing that stands in the file, and read nothing huge."""
    database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_BYTES)
    database.execute("PRAGMA trusted_schema=OFF")
    database.execute("PRAGMA cell_size_check=ON")


def check_schema(database: sqlite3.Connection, path: Path, tables: str) -> None:
    """Refuse tables that are not as `tables` (SQL) makes them, or anything beside them.

    Raises `InputError`, and `sqlite3.Error` where the file cannot be read.
    """
    found = _schema(database)
    with closing(sqlite3.connect(":memory:")) as model:
        model.executescript(tables)
        wanted = _schema(model)
    for name in [n for n in found if n not in wanted or found[n] != wanted[n]]:
        kind, _ = found[name]
        raise InputError(
            f"{path}: holds the {kind} {name[:40]!r}, which this program did not make so: {_ADVICE}"
        )
    missing = [name for name in wanted if name not in found]
    if missing:
        raise InputError(f"{path}: has no {missing[0]!r}: not a whole record: {_ADVICE}")


def only_tables(database: sqlite3.Connection, path: Path) -> None:
    """Refuse views, triggers and virtual tables, which run something when they are only read."""
    for name, (kind, sql) in _schema(database).items():
        if kind not in ("table", "index") or "VIRTUAL" in str(sql).upper()[:40]:
            raise InputError(
                f"{path}: holds the {kind} {name[:40]!r}, which no record of this program does: "
                f"{_ADVICE}"
            )


def _schema(database: sqlite3.Connection) -> dict[str, tuple[str, object]]:
    """Kind and SQL of everything in a database by name, but for what SQLite makes for itself."""
    rows = database.execute("SELECT type, name, sql FROM sqlite_master").fetchall()
    return {
        str(name): (str(kind), sql)
        for kind, name, sql in rows
        if not (sql is None and str(name).startswith("sqlite_autoindex_"))
        and not (kind == "table" and str(name).startswith("sqlite_stat"))
    }


def check_values(
    database: sqlite3.Connection, path: Path, kinds: Mapping[str, str | Sequence[str]]
) -> None:
    """Refuse values that no scan can have written.

    `kinds` says for each column of the readings: `int`, `float`, `str`, or the words allowed.
    Raises `InputError`, and `sqlite3.Error` where the file is damaged.
    """
    fault = database.execute("PRAGMA quick_check(1)").fetchone()[0]
    if fault != "ok":
        raise InputError(f"{path}: is damaged ({str(fault)[:200]}): {_ADVICE}")
    for text in _wrong(database, kinds):
        raise InputError(f"{path}: {text}: {_ADVICE}")


def _wrong(database: sqlite3.Connection, kinds: Mapping[str, str | Sequence[str]]) -> Iterator[str]:
    yield from _wrong_size(database)
    for table in _READINGS:
        for column, kind in kinds.items():
            yield from _wrong_column(database, table, column, kind)
    yield from _wrong_checks(database)
    yield from _wrong_texts(database)
    yield from _wrong_darks(database)
    yield from _wrong_pictures(database)


def _wrong_size(database: sqlite3.Connection) -> Iterator[str]:
    counts = "SELECT COUNT(*), SUM(kind = 'point'), SUM(kind = 'drift'), COUNT(DISTINCT block)"
    total, points, drifts, blocks = database.execute(f"{counts} FROM reading").fetchone()
    if total > MOST_READINGS or (points or 0) * ((drifts or 0) + blocks) > MOST_WORK:
        yield f"{total} readings, {drifts} of them drift checks, in {blocks} blocks are too many"
    twice = "FROM reading WHERE kind = 'drift' GROUP BY block, time_s HAVING COUNT(*) > 1 LIMIT 1"
    for step, time_s in database.execute(f"SELECT MAX(step), time_s {twice}"):
        yield f"reading {step!r}: a second drift check at {time_s!r} s; allowed: one at a time"


def _wrong_column(
    database: sqlite3.Connection, table: str, column: str, kind: str | Sequence[str]
) -> Iterator[str]:
    if kind == "float":
        low, high = _LIMITS.get(column, (-_HIGHEST, _HIGHEST))
        known = f"typeof({column}) = 'real' AND {column} BETWEEN {low!r} AND {high!r}"
        sound = known if column in _ALWAYS_KNOWN else f"({column} IS NULL OR ({known}))"
        allowed = f"a number from {low:g} to {high:g}"
    elif kind == "int":
        sound = f"typeof({column}) = 'integer' AND {column} BETWEEN 0 AND {_LARGEST_WHOLE}"
        allowed = f"a whole number from 0 to {_LARGEST_WHOLE}"
    elif kind == "str":
        sound, allowed = f"typeof({column}) = 'text' AND length({column}) <= 1000", "a short text"
    else:
        sound = f"{column} IN ({', '.join(map(repr, kind))})"
        allowed = " or ".join(kind)
    short = f"CASE WHEN typeof({column}) IN ('text', 'blob') THEN substr({column}, 1, 40) ELSE"
    sql = f"SELECT step, {short} {column} END FROM {table} WHERE NOT ({sound}) LIMIT 1"
    for step, value in database.execute(sql):
        yield f"{table} {step!r}: {column} is {value!r}; allowed: {allowed}"


def _wrong_checks(database: sqlite3.Connection) -> Iterator[str]:
    """What was expected of a drift reference that was measured again."""
    known = "typeof(expected) = 'real' AND typeof(u_expected) = 'real' AND u_expected >= 0"
    whole = "typeof(before_step) = 'integer' AND jumped IN (0, 1)"
    sql = f"SELECT before_step FROM drift_at_resume WHERE NOT ({known} AND {whole}) LIMIT 1"
    for (step,) in database.execute(sql):
        yield f"the drift reference before step {step!r} holds what is no number"


def _wrong_texts(database: sqlite3.Connection) -> Iterator[str]:
    """Texts that reach the table of results: none may pass for a formula, or command a terminal."""
    for column in ("flags", "time_utc"):
        for (text,) in database.execute(f"SELECT DISTINCT {column} FROM reading"):
            if first_unfit(text) or "\n" in text or text[:1] in ("=", "+", "-", "@", "\t"):
                yield f"a reading's {column} is {text[:40]!r}; allowed: plain words"
    for key, value in database.execute("SELECT key, value FROM meta"):
        if not (isinstance(key, str) and isinstance(value, str)):
            yield f"meta {str(key)[:40]!r} is no text"
        elif key in ("steps", "hidden") and not (value.isdecimal() and len(value) < 10):
            yield f"meta {key!r} is {value[:40]!r}; allowed: a whole number"
    for row in database.execute("SELECT role, identity FROM device"):
        if not all(isinstance(value, str) for value in row):
            yield "a device's role or identity is no text"


def _wrong_darks(database: sqlite3.Connection) -> Iterator[str]:
    kinds = "typeof(frames) = 'integer' AND frames > 0 AND exposure_s > 0"
    for column in ("exposure_s", "mean_dn", "noise_dn"):
        kinds += f" AND typeof({column}) = 'real' AND abs({column}) <= {_HIGHEST!r}"
    for (number,) in database.execute(f"SELECT id FROM dark WHERE NOT ({kinds}) LIMIT 1"):
        yield f"dark {number!r} holds what is no number of counts, frames or seconds"


def _wrong_pictures(database: sqlite3.Connection) -> Iterator[str]:
    sizes = "SELECT TOTAL(length(png)), MAX(length(png)) FROM preview"
    for size, most in zip(database.execute(sizes).fetchone(), _PICTURES, strict=True):
        if (size or 0) > most:
            yield f"pictures of {size:.0f} bytes; allowed: {most}"
    for step, caption, kind, outline in database.execute(
        "SELECT step, caption, typeof(png), polygon FROM preview"
    ):
        if not isinstance(caption, str) or kind != "blob" or not _is_outline(outline):
            yield f"picture {step!r} has no caption, no bytes or no outline that can be read"


def _is_outline(text: object) -> bool:
    """Whether a text is JSON of pairs of numbers."""
    if not isinstance(text, str) or len(text) > _PICTURE_CORNERS:
        return False
    try:
        corners = json.loads(text)
        return isinstance(corners, list) and all(
            len(corner) == 2 and all(_is_finite(value) for value in corner) for corner in corners
        )
    except (ValueError, TypeError, RecursionError):
        return False


def _is_finite(value: object) -> bool:
    return isinstance(value, float | int) and abs(value) < _HIGHEST and math.isfinite(value)
