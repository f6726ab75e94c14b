"""Run folders as a stranger may send them: one sound run, and what can be done to its record."""

from __future__ import annotations

import os
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from instrument.record.record import FILE_NAME

SCRIPT = "<script>alert(1)</script>"


@dataclass(frozen=True)
class Sent:
    """A folder that was sent, and a file of the receiver's outside it that must stay as it is."""

    folder: Path
    victim: Path

    @property
    def record(self) -> Path:
        return self.folder / FILE_NAME

    def sql(self, *statements: str) -> None:
        with closing(sqlite3.connect(self.record)) as database:
            for statement in statements:
                database.execute(statement)
            database.commit()

    def link(self, name: str) -> None:
        """Put a link to the receiver's file in place of one of the folder's."""
        (self.folder / name).unlink(missing_ok=True)
        (self.folder / name).symlink_to(self.victim)


def copy_of(run: Path, to: Path) -> Sent:
    """The run as it was sent, in its own folder of `to`."""
    shutil.copytree(run, to / "sent")
    victim = to / "mine.txt"
    victim.write_text("my own\n")
    return Sent(to / "sent", victim)


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


def _lenient(column: str, value: str) -> Callable[[Sent], None]:
    return lambda sent: sent.sql(f"UPDATE reading SET {column} = {value} WHERE step = 2")


def _damaged(sent: Sent) -> None:
    data = bytearray(sent.record.read_bytes())
    for start in range(4096, len(data), 4096):
        data[start : start + 300] = os.urandom(300)
    sent.record.write_bytes(data)


def _fifo(sent: Sent) -> None:
    sent.record.unlink()
    os.mkfifo(sent.record)


# What was done to the record, and what the refusal says.
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
        lambda sent: sent.sql("ALTER TABLE dark ADD COLUMN x AS (zeroblob(1000000000))"),
        "holds the table 'dark'",
    ),
    "a table missing": (lambda sent: sent.sql("DROP TABLE preview"), "has no 'preview'"),
    "another version": (
        lambda sent: sent.sql("UPDATE meta SET value = '1' WHERE key = 'schema_version'"),
        "schema version 1; this program reads",
    ),
    "text for a number": (_lenient("signal_dn", "'many'"), "signal_dn is 'many'"),
    "bytes for a number": (_lenient("frames", "x'00'"), "frames is b'\\x00'"),
    "a number for text": (_lenient("flags", "x'ff'"), "flags is b'\\xff'"),
    "text that is not UTF-8": (_lenient("flags", "CAST(x'ff' AS TEXT)"), "not a record of this"),
    "a negative step": (_lenient("step", "-1"), "step is -1; allowed: a whole number from 0"),
    "no angle": (_lenient("theta_r_deg", "NULL"), "theta_r_deg is None"),
    "an angle past the horizon": (_lenient("theta_i_deg", "95.0"), "allowed: a number from 0 to"),
    "no exposure": (_lenient("exposure_s", "0.0"), "exposure_s is 0.0"),
    "an infinite signal": (_lenient("signal_dn", "9e999"), "signal_dn is inf"),
    "an unknown kind": (_lenient("kind", "'x'"), "kind is 'x'; allowed: point or tile or drift"),
    "a formula": (_lenient("flags", "'=cmd|x!A1'"), "flags is '=cmd|x!A1'; allowed: plain words"),
    "a command to the terminal": (_lenient("flags", "char(27) || '[2J'"), "flags is '\\x1b[2J'"),
    "a formula for a time": (_lenient("time_utc", "'+1'"), "time_utc is '+1'"),
    "two drift checks at once": (
        lambda sent: sent.sql("UPDATE reading SET time_s = 1.0"),
        "a second drift check at 1.0 s",
    ),
    "meta that is no number": (
        lambda sent: sent.sql("UPDATE meta SET value = 'x' WHERE key = 'steps'"),
        "meta 'steps' is 'x'; allowed: a whole number",
    ),
    "a dark of nothing": (lambda sent: sent.sql("UPDATE dark SET mean_dn = 'x'"), "dark 1 holds"),
    "an outline that is none": (
        lambda sent: sent.sql(f"UPDATE preview SET polygon = '{'[' * 5000}'"),
        "no outline that can be read",
    ),
    "a picture that is text": (lambda sent: sent.sql("UPDATE preview SET png = 'x'"), "no bytes"),
    "damaged pages": (_damaged, "record.sqlite: "),
    "half the file": (
        lambda sent: sent.record.write_bytes(sent.record.read_bytes()[:10_000]),
        "record.sqlite: ",
    ),
    "another kind of file": (lambda sent: sent.record.write_text("no" * 9999), "not a record of"),
    "a link as the record": (lambda sent: sent.link(FILE_NAME), "is a link or no file"),
    "a link as its log": (lambda sent: sent.link(f"{FILE_NAME}-wal"), "is a link or no file"),
    "a link as its index": (lambda sent: sent.link(f"{FILE_NAME}-shm"), "is a link or no file"),
    "a link as the lock": (lambda sent: sent.link(".scanning"), "is a link or no file"),
    "a journal": (
        lambda sent: (sent.folder / f"{FILE_NAME}-journal").write_bytes(b"x"),
        "-journal: stopped before the record had begun",
    ),
    "a pipe as the record": (_fifo, "record.sqlite"),
}  # fmt: skip
