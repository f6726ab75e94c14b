"""Schema of the record: unchanged once released, a column for each value, enforced on writing.

The rules against forged files are tested in `test_validation`.
"""

from __future__ import annotations

import hashlib
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import fields
from pathlib import Path

import pytest

from instrument.record import schema
from instrument.record.older_versions import OLDER_SQL
from instrument.record.reading import Check, Reading
from instrument.record.record import Record
from tests.support.storage.sample_records import reading


@pytest.fixture
def database() -> Iterator[sqlite3.Connection]:
    with closing(sqlite3.connect(":memory:")) as database:
        database.executescript(schema.SQL)
        yield database


DIGESTS = {
    3: "9f19a8226c2bf34aba7f2e90b0857037188d10962a30af3a6da4e589df4eeab4",
    4: "3ca133c29e7090078baff85f88ef8f3e97e1c13f0aecddd88d0414542926cf20",
    5: "3ada554edb836b921d186084f62e71ed224ba3bf9c79a1c8216e84f3e90050cb",
    6: "600ca44f85780d01b3573bee848aa5a800e105b4db200821a7aba3c3ff440832",
    7: "0013ac68d5709863210f2f7ca687a7cb7e3c25b878d33f7169f128ff1ec91c5e",
    8: "89ac6088ad1e3d2e2aa7a131fe6fab40b3a2f1394b424a25b3994ab7c726b1e7",
}


def digest(sql: str) -> str:
    """Digest of the tables' texts as SQLite keeps them."""
    with closing(sqlite3.connect(":memory:")) as database:
        database.executescript(sql)
        rows = database.execute("SELECT name, sql FROM sqlite_schema ORDER BY name").fetchall()
        return hashlib.sha256(repr(rows).encode()).hexdigest()


def test_the_schema_of_each_version_is_what_it_was_when_released() -> None:
    """A record is recognised by the exact text: whoever changes it needs a new version."""
    texts = {**OLDER_SQL, schema.SCHEMA_VERSION: schema.SQL}
    assert {version: digest(text) for version, text in texts.items()} == DIGESTS


def test_a_reading_has_a_column_for_each_value_in_order() -> None:
    values = [f.name for f in fields(Reading)]
    assert [column.name for column in schema.TABLES["reading"]] == values
    own = [f.name for f in fields(Check) if f.name != "reading"]
    assert [column.name for column in schema.TABLES["drift_at_resume"]] == own + values
    assert schema.SQL.count("crc32 INTEGER NOT NULL") == len(schema.TABLES)
    types = {"INTEGER": "int", "REAL": "float", "TEXT": "str"}
    for column, field in zip(schema.TABLES["reading"], fields(Reading), strict=True):
        assert types[column.sql_type] == {"Kind": "str", "Surface": "str"}.get(
            str(field.type), field.type
        )


def test_every_table_is_strict_and_every_constraint_named(database: sqlite3.Connection) -> None:
    tables = database.execute("SELECT name, strict FROM pragma_table_list").fetchall()
    assert {
        name: strict for name, strict in tables if not name.startswith("sqlite_")
    } == dict.fromkeys(schema.TABLES, 1)
    for (sql,) in database.execute("SELECT sql FROM sqlite_schema WHERE sql IS NOT NULL"):
        assert sql.count(" CHECK (") == sql.count(" CONSTRAINT ")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"theta_i_deg": 95.0}, "theta_i_deg: a number from 0 to 89.5"),
        ({"signal_dn": float("inf")}, "signal_dn: a number from"),
        ({"u_noise_dn": -1.0}, "u_noise_dn: a number from 0 to"),
        ({"frames": -1}, "frames: a whole number from 0 to"),
        ({"kind": "x"}, "kind: point or tile or drift"),
        ({"flags": "=1"}, "flags: plain words in ASCII"),
        ({"flags": "é"}, "flags: plain words in ASCII"),
        ({"theta_r_deg": float("nan")}, "NOT NULL constraint failed: reading.theta_r_deg"),
        ({"signal_dn": "many"}, "cannot store TEXT value in REAL column reading.signal_dn"),
    ],
)
def test_a_value_that_is_not_allowed_cannot_be_written(
    tmp_path: Path, changes: dict[str, object], words: str
) -> None:
    """SQLite names the constraint, which says what is allowed."""
    with (
        Record.create(tmp_path / "run", {}) as record,
        pytest.raises(sqlite3.IntegrityError, match=words),
    ):
        record.add_reading(reading(**changes))  # type: ignore[arg-type]  # a test's shorthand


def test_one_preview_has_at_most_128_mb(database: sqlite3.Connection) -> None:
    with pytest.raises(sqlite3.IntegrityError, match="png: bytes, at most 134217728"):
        database.execute("INSERT INTO preview VALUES (0, '', zeroblob(134217729), '[]', 0)")
