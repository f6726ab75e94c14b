"""Write lock of a record: another program may hold it for a while, the scan waits.

A person who looks into the record with a table editor holds the lock until a change is saved.
"""

from __future__ import annotations

import logging
import os
import sqlite3
from pathlib import Path

from instrument.clock import Clock, SystemClock
from instrument.errors import StorageError
from instrument.processes import locking, named, opened_by

log = logging.getLogger(__name__)

PATIENCE_S = 60.0  # longer than a person needs to press Save
NOTICE_S = 2.0  # after which the wait is logged
TRY_S = 0.1  # of SQLite's own wait, during which no signal is handled
_PAUSE_S = 0.02
# SQLite's write-ahead log: the writer locks this byte of the file NAME-shm (WAL_WRITE_LOCK in
# "WAL-mode File Format", section 2.3.1, and UNIX_SHM_BASE in os_unix.c of SQLite).
_WRITE_LOCK = 120


def is_busy(error: sqlite3.Error) -> bool:
    """Return True if another connection holds the lock that was needed."""
    return str(getattr(error, "sqlite_errorname", "")).startswith("SQLITE_BUSY")


def begin_writing(database: sqlite3.Connection, path: Path, clock: Clock | None = None) -> None:
    """Begin a transaction with the write lock; wait for it as long as PATIENCE_S.

    Raises `StorageError` that names the program which holds the lock.
    """
    clock = clock or SystemClock()
    begun_s, noticed = clock.now_s(), False
    while True:
        try:
            database.execute("BEGIN IMMEDIATE")
            return
        except sqlite3.OperationalError as error:
            if not is_busy(error):
                raise
        waited_s = clock.now_s() - begun_s
        if waited_s > PATIENCE_S:
            raise StorageError(held_by_another(path, f"for {PATIENCE_S:g} s"))
        if waited_s > NOTICE_S and not noticed:
            noticed = True
            log.warning("%s; waiting %g s for it", held_by_another(path), PATIENCE_S)
        clock.sleep(_PAUSE_S)


def held_by_another(path: Path, since: str = "") -> str:
    """Return the message for a record whose lock another program holds."""
    return (
        f"{path}: {lock_holder(path)} holds the record{since and ' '}{since}: save or discard the "
        "changes there, or close it"
    )


def lock_holder(path: Path) -> str:
    """Return the process that holds the record's write lock, in words with its number.

    Where Linux does not show it: the processes that have the file open, or "another program".
    """
    own = os.getpid()
    holders = [pid for pid in locking(Path(f"{path}-shm"), _WRITE_LOCK) if pid != own]
    if holders:
        return ", ".join(map(named, holders))
    users = [pid for pid in opened_by(path) if pid != own]
    if users:
        return f"one of those that have it open: {', '.join(map(named, users))}"
    return "another program"
