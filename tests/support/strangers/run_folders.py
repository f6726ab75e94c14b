"""Run folders from elsewhere: a valid run in each schema version, and changes to its record."""

from __future__ import annotations

import os
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from instrument.record.record import FILE_NAME
from instrument.record.schema import SCHEMA_VERSION
from tests.support.command import finished_run
from tests.support.paths import CONFIGS
from tests.support.scans import small_rig
from tests.support.storage.older_records import as_version, seal_again

SCRIPT = "<script>alert(1)</script>"


@dataclass(frozen=True)
class Sent:
    """A received run folder, and a file outside it that must not change."""

    folder: Path
    victim: Path

    @property
    def record(self) -> Path:
        return self.folder / FILE_NAME

    def sql(self, *statements: str) -> None:
        """Run statements under the rules of the tables, and seal the rows again."""
        with closing(sqlite3.connect(self.record)) as database:
            for statement in statements:
                database.execute(statement)
            seal_again(database)
            database.commit()

    def forge(self, *statements: str) -> None:
        """Run statements as if the tables had no rules, then restore seals and schema."""
        with closing(sqlite3.connect(self.record, isolation_level=None)) as database:
            own = database.execute("SELECT sql, name FROM sqlite_schema WHERE sql IS NOT NULL")
            texts = own.fetchall()
            lax = [(text.replace(" STRICT", "").replace(" NOT NULL", ""), n) for text, n in texts]
            database.execute("PRAGMA ignore_check_constraints = ON")
            _write_schema(database, lax)
            for statement in statements:
                database.execute(statement)
            seal_again(database)
            _write_schema(database, texts)

    def widen(self, old: str, new: str) -> None:
        """Change the text of the schema, so that SQLite enforces fewer rules."""
        with closing(sqlite3.connect(self.record, isolation_level=None)) as database:
            rows = database.execute("SELECT sql, name FROM sqlite_schema").fetchall()
            changed = [(text.replace(old, new), name) for text, name in rows if old in (text or "")]
            assert changed
            _write_schema(database, changed)

    def link(self, name: str) -> None:
        """Replace a file of the folder by a link to the file outside."""
        (self.folder / name).unlink(missing_ok=True)
        (self.folder / name).symlink_to(self.victim)


def _write_schema(database: sqlite3.Connection, texts: list[tuple[str, str]]) -> None:
    database.execute("PRAGMA writable_schema = ON")
    database.executemany("UPDATE sqlite_schema SET sql = ? WHERE name = ?", texts)
    database.execute("PRAGMA writable_schema = RESET")  # makes SQLite read the schema again


def run_few_points(folder: Path) -> Path:
    """Run the demo, matt, with few angles, pixels and models; return its folder, in `folder`."""
    text = (CONFIGS / "protocols" / "demo.yaml").read_text().replace("num: 33", "num: 5")
    protocol = folder / "few.yaml"
    text = text.replace("[30.0, 45.0, 60.0]", "[30.0, 60.0]")
    text = text.replace("../rigs/bench_12bit.yaml", str(small_rig(folder)))
    text = text.replace("oren_nayar+torrance_sparrow", "oren_nayar").replace(", ks: 0.076", "")
    protocol.write_text(f"{text}fit: {{models: [lambert, oren_nayar]}}\n")
    return finished_run(protocol, folder / "run")


def copy_of(run: Path, to: Path, version: int = SCHEMA_VERSION) -> Sent:
    """Copy a run into a folder of `to`, its record in that schema version."""
    shutil.copytree(_in_version(run, version), to / "sent")
    victim = to / "mine.txt"
    victim.write_text("my own\n")
    return Sent(to / "sent", victim)


def _in_version(run: Path, version: int) -> Path:
    """Return the run, or a copy beside it in an older schema version, made once."""
    if version == SCHEMA_VERSION:
        return run
    older = run.with_name(f"{run.name} version {version}")
    if not older.exists():
        shutil.copytree(run, older)
        as_version(older, version)
    return older


def _view(sent: Sent) -> None:
    sent.sql(
        "ALTER TABLE reading RENAME TO hidden",
        "CREATE VIEW reading AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) "
        "SELECT hidden.* FROM hidden, n",
    )


def _view_of_meta(sent: Sent) -> None:
    sent.sql(
        "ALTER TABLE meta RENAME TO hidden",
        "CREATE VIEW meta AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) "
        "SELECT 'k' || i AS key, i AS value FROM n",
    )


def _forged(column: str, value: str) -> Callable[[Sent], None]:
    return lambda sent: sent.forge(f"UPDATE reading SET {column} = {value} WHERE step = 2")


def _damaged(sent: Sent) -> None:
    data = bytearray(sent.record.read_bytes())
    for start in range(4096, len(data), 4096):
        data[start : start + 300] = os.urandom(300)
    sent.record.write_bytes(data)


def _read_only(sent: Sent) -> None:
    data = bytearray(sent.record.read_bytes())
    data[18] = 3  # write version of the file format
    sent.record.write_bytes(data)


def _fifo(sent: Sent) -> None:
    sent.record.unlink()
    os.mkfifo(sent.record)


# A change to the record, and words of the refusal.
REFUSED: dict[str, tuple[Callable[[Sent], None], str]] = {
    "a view in place of the readings": (_view, "holds the view 'reading'"),
    "a view without end in place of meta": (_view_of_meta, "holds the view 'meta'"),
    "a trigger": (
        lambda sent: sent.sql("CREATE TRIGGER t AFTER INSERT ON event BEGIN DELETE FROM meta; END"),
        "holds the trigger 't'",
    ),
    "a virtual table": (
        lambda sent: sent.sql("CREATE VIRTUAL TABLE v USING fts5(x)"),
        "holds the table 'v",
    ),
    "a further table": (lambda sent: sent.sql("CREATE TABLE more (x)"), "holds the table 'more'"),
    "other columns": (
        lambda sent: sent.sql("ALTER TABLE dark ADD COLUMN x BLOB AS (zeroblob(1000000000))"),
        "holds the table 'dark'",
    ),
    "a table missing": (lambda sent: sent.sql("DROP TABLE preview"), "has no 'preview'"),
    "another version": (
        lambda sent: sent.forge("UPDATE meta SET value = '1' WHERE key = 'schema_version'"),
        "schema version 1; this program reads",
    ),
    "a version that is no text": (
        lambda sent: sent.forge("UPDATE meta SET value = x'34' WHERE key = 'schema_version'"),
        "schema version b'4'; this program reads",
    ),
    "no version": (
        lambda sent: sent.sql("DELETE FROM meta WHERE key = 'schema_version'"),
        "schema version None; this program reads",
    ),
    "a column without its rule": (
        lambda sent: sent.widen("signal_dn REAL", "signal_dn BLOB"),
        "holds the table 'reading', which this program did not create so",
    ),
    "text for a number": (_forged("signal_dn", "'many'"), "signal_dn is 'many'"),
    "bytes for a number": (_forged("frames", "x'00'"), "frames is b'\\x00'"),
    "a number for text": (_forged("flags", "x'ff'"), "flags is b'\\xff'"),
    "text that is not UTF-8": (_forged("flags", "CAST(x'ff' AS TEXT)"), "not a record of this"),
    "a negative step": (_forged("step", "-1"), "step is -1; allowed: a whole number from 0"),
    "no angle": (_forged("theta_r_deg", "NULL"), "theta_r_deg is None"),
    "an angle past the horizon": (_forged("theta_i_deg", "95.0"), "allowed: a number from 0 to"),
    "no exposure": (_forged("exposure_s", "0.0"), "exposure_s is 0.0"),
    "an infinite signal": (_forged("signal_dn", "9e999"), "signal_dn is inf"),
    "an unknown kind": (_forged("kind", "'x'"), "kind is 'x'; allowed: point or tile or drift"),
    "a formula": (_forged("flags", "'=cmd|x!A1'"), "flags is '=cmd|x!A1'; allowed: plain words"),
    "a command to the terminal": (_forged("flags", "char(27) || '[2J'"), "flags is '\\x1b[2J'"),
    "a formula for a time": (_forged("time_utc", "'+1'"), "time_utc is '+1'"),
    "two drift checks at once": (
        lambda sent: sent.forge("UPDATE reading SET time_s = 1.0"),
        "a second drift check at 1.0 s",
    ),
    "a negative uncertainty": (_forged("u_noise_dn", "-1.0"), "u_noise_dn is -1.0; allowed"),
    "a null character": (_forged("flags", "'a' || char(0) || 'b'"), "flags is 'a"),
    "a count with a null character": (
        lambda sent: sent.forge("UPDATE meta SET value = '1' || char(0) WHERE key = 'steps'"),
        "meta 'steps': value is '1",
    ),
    "an event that is not UTF-8": (
        lambda sent: sent.forge("UPDATE event SET text = CAST(x'ff' AS TEXT)"),
        "not a record of this program",
    ),
    "meta that is no number": (
        lambda sent: sent.forge("UPDATE meta SET value = 'x' WHERE key = 'steps'"),
        "meta 'steps': value is 'x'; allowed: a whole number",
    ),
    "a dark of nothing": (
        lambda sent: sent.forge("UPDATE dark SET mean_dn = 'x'"),
        "dark 1: mean_dn is 'x'; allowed: a number from",
    ),
    "an outline that is none": (
        lambda sent: sent.forge(f"UPDATE preview SET polygon = '{'[' * 5000}'"),
        "no outline that can be read",
    ),
    "a picture that is text": (
        lambda sent: sent.forge("UPDATE preview SET png = 'x'"),
        "png is 'x'; allowed: bytes",
    ),
    "damaged pages": (_damaged, "record.sqlite: "),
    "a header that makes it read-only": (_read_only, "its header forbids writing"),
    "half the file": (
        lambda sent: sent.record.write_bytes(sent.record.read_bytes()[:10_000]),
        "record.sqlite: ",
    ),
    "another kind of file": (lambda sent: sent.record.write_text("no" * 9999), "not a record of"),
    "a link as the record": (lambda sent: sent.link(FILE_NAME), "is a link or no file"),
    "a link as its log": (lambda sent: sent.link(f"{FILE_NAME}-wal"), "is a link or no file"),
    "a link as its index": (lambda sent: sent.link(f"{FILE_NAME}-shm"), "is a link or no file"),
    "a journal": (
        lambda sent: (sent.folder / f"{FILE_NAME}-journal").write_bytes(b"x"),
        "-journal: stopped before the record had begun",
    ),
    "a pipe as the record": (_fifo, "record.sqlite"),
}  # fmt: skip
