"""Process that keeps a record from being written."""

from __future__ import annotations

import os
from pathlib import Path

from instrument.processes import locking, named, opened_by

# SQLite's write-ahead log: the writer locks this byte of the file NAME-shm (WAL_WRITE_LOCK in
# "WAL-mode File Format", section 2.3.1, and UNIX_SHM_BASE in os_unix.c of SQLite).
_WRITE_LOCK = 120


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
