"""Files of a record's database: made by this process, known again, removed only if its own."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

SIDE_FILES = ("-wal", "-shm")
"""Ends of the names of the write-ahead log and its index, which stand beside the database."""


def create_file(path: Path) -> os.stat_result:
    """Create an empty file and return its identity; raise `OSError` if the name is taken."""
    number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o644)
    try:
        return os.fstat(number)
    finally:
        os.close(number)


def remove_database(path: Path, own: os.stat_result) -> None:
    """Remove a database that could not be begun, with its side files, if it is still `own`."""
    with suppress(OSError):
        if is_same(path.lstat(), own):
            for end in ("-journal", *SIDE_FILES, ""):
                Path(f"{path}{end}").unlink(missing_ok=True)


def is_same(one: os.stat_result, other: os.stat_result) -> bool:
    """Return True for the same file, under whichever name."""
    return os.path.samestat(one, other)


def path_of(file: os.stat_result) -> Path | None:
    """Return the current path of a file that this process has open, None if it is not found.

    Of a removed file the path does not exist.
    """
    for link in Path("/proc/self/fd").iterdir():
        try:
            if is_same(link.stat(), file):
                return link.readlink()
        except OSError:
            continue  # the descriptor of the listing itself, closed by now
    return None
