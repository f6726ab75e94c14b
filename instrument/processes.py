"""Processes that lock a file or have it open, as far as Linux shows them in /proc."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from instrument.text.terminal_safe import escape_control_characters

_LONGEST = 60  # characters of a command line that are shown
_PROC = Path("/proc")


def locking(file: Path, byte: int = 0) -> Iterator[int]:
    """Yield the processes with an exclusive lock on a byte of the file, or on all of it.

    A line of /proc/locks: `1: POSIX  ADVISORY  WRITE 4711 08:01:1234 120 120`.
    """
    try:
        inode = file.stat().st_ino
        lines = (_PROC / "locks").read_text().splitlines()
    except OSError:
        return
    for words in map(str.split, lines):
        if len(words) != 8 or words[3] != "WRITE" or words[5].rpartition(":")[2] != str(inode):
            continue
        last = float("inf") if words[7] == "EOF" else int(words[7])
        if int(words[6]) <= byte <= last and int(words[4]) > 0:
            yield int(words[4])


def opened_by(file: Path) -> Iterator[int]:
    """Yield the processes that have a file open; those of other users are not visible."""
    try:
        wanted = file.stat()
    except OSError:
        return
    for process in _PROC.glob("[0-9]*"):
        with suppress(OSError):  # ended meanwhile, or of another user
            if any(_is_same(link, wanted) for link in (process / "fd").iterdir()):
                yield int(process.name)


def _is_same(link: Path, wanted: os.stat_result) -> bool:
    try:
        return os.path.samestat(link.stat(), wanted)
    except OSError:
        return False


def named(pid: int) -> str:
    """Return a process as its number and its command line."""
    try:
        words = (_PROC / str(pid) / "cmdline").read_bytes().replace(b"\0", b" ")
    except OSError:
        words = b""
    command = escape_control_characters(" ".join(words.decode(errors="replace").split()))
    if not command:
        return f"process {pid}"
    short = command if len(command) <= _LONGEST else command[:_LONGEST] + "..."
    return f"process {pid} ({short})"
