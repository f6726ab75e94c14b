"""Files of a record's database: made by this process, known again, removed only if its own.

Beside the database stand its write-ahead log NAME-wal, with the latest rows, and its index
NAME-shm, with the locks. A process that has them open does not notice if they are removed, and its
rows end with it. The numbers are those of SQLite's "WAL-mode File Format", sections 1.2 and 2.1.
"""

from __future__ import annotations

import os
import sqlite3
import struct
from contextlib import suppress
from os.path import samestat
from pathlib import Path

SIDE_FILES = ("-wal", "-shm")
_WAL_HEADER, _FRAME_HEADER = 32, 24  # bytes
_INDEX_BLOCK = 32768  # bytes: the least that the index has


class SideFiles:
    """Write-ahead log and index that a connection has open, by their identity."""

    def __init__(self, database: Path) -> None:
        self._log, self._index = (Path(f"{database}{end}") for end in SIDE_FILES)
        both = (self._log, self._index)
        self._own = {path: path.stat() for path in both if path.exists()}  # not of a foreign file

    def loss(self) -> str:
        """Return which file was removed, replaced or cut, in words; empty if none was."""
        for path, own in self._own.items():
            try:
                if not samestat(path.lstat(), own):
                    return f"{path} was replaced"
            except OSError:
                return f"{path} was removed"
        return next((f"{path} was cut" for path in self._own if self._is_cut(path)), "")

    def save(self, database: sqlite3.Connection) -> bool:
        """Move the rows of the log into the database; return False if some are lost."""
        if not self._restore():
            return False
        try:
            _, in_log, moved = database.execute("PRAGMA wal_checkpoint(FULL)").fetchone()
        except sqlite3.Error:
            return False
        return bool(in_log == moved)

    def _restore(self) -> bool:
        """Make what is left usable for SQLite; return False if rows of the log are lost.

        A cut log is read again as after a crash, since its index is made empty: its whole rows
        count, up to the cut. An index that was cut itself gets its size again, since to touch
        memory beyond the end of its file would end the process.
        """
        cut = [path for path in self._own if path.exists() and self._is_cut(path)]
        own = self._own.get(self._index)
        if cut and own is not None and self._index.exists() and samestat(self._index.lstat(), own):
            size = max(own.st_size, self._index.stat().st_size, _INDEX_BLOCK)
            for length in (0, size):
                os.truncate(self._index, length)
        return self._log not in cut

    def _is_cut(self, path: Path) -> bool:
        size = path.stat().st_size
        if path == self._index:
            return size < _INDEX_BLOCK
        header = _read_open_file(self._own.get(self._index), 20)
        if len(header) < 20:
            return False  # without its index the log cannot be judged
        page_bytes, frames = struct.unpack("=14xHI", header)
        page_bytes = 65536 if page_bytes == 1 else page_bytes
        return bool(frames) and size < _WAL_HEADER + frames * (_FRAME_HEADER + page_bytes)


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
        if samestat(path.lstat(), own):
            for end in ("-journal", *SIDE_FILES, ""):
                Path(f"{path}{end}").unlink(missing_ok=True)


def _read_open_file(file: os.stat_result | None, size: int) -> bytes:
    """Return the first bytes of a file that SQLite has open, through its own descriptor.

    The file must not be opened here: closing any descriptor of it would release all locks that this
    process has on it (POSIX, fcntl), and another program would then empty the index in use.
    """
    number = None if file is None else _descriptor(file)
    return b"" if number is None else os.pread(number, size, 0)


def _descriptor(file: os.stat_result) -> int | None:
    """Return the number of a descriptor of this process for a file, None without one."""
    for link in Path("/proc/self/fd").iterdir():
        with suppress(OSError):  # the descriptor of the listing itself, closed by now
            if samestat(link.stat(), file):
                return int(link.name)
    return None


def path_of(file: os.stat_result) -> Path | None:
    """Return the current path of a file that this process has open, None if it is not found.

    Of a removed file the path does not exist.
    """
    number = _descriptor(file)
    return None if number is None else Path(f"/proc/self/fd/{number}").readlink()


def absence_text(now: Path | None) -> str:
    """Explain why the record's file is no longer where it was; `now`: its path, if it has one."""
    if now is None or not now.is_file():
        return "was removed while the scan ran, and the readings with it: run again"
    return "was moved while the scan ran: nothing accepted is lost"


def no_record_text(path: Path, file: str) -> str:
    """Return that a path is no run's folder, and which one may be meant."""
    if (path.parent / file).is_file():
        return f"is a file of a run; name the run's folder: {path.parent}"
    if path.is_file():
        return "is a file; name the folder of a run"
    return f"no {file} there: name the folder of a run"
