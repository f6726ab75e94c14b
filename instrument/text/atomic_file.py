"""Atomic, durable writing of files; bounded reading; errors of the disk in words."""

from __future__ import annotations

import errno
import os
import shutil
import stat
from contextlib import suppress
from pathlib import Path

from instrument.errors import StorageError

_FORBIDDEN = (errno.EROFS, errno.EACCES, errno.EPERM)


def write_whole(path: Path, content: str | bytes) -> None:
    """Write bytes, or text as UTF-8, under a temporary name, flush to disk, then rename.

    A reader of `path` sees the old file or the whole new one, also after a power cut.
    Raises `StorageError`.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.unlink(missing_ok=True)  # it may be a link to another file
        data = content if isinstance(content, bytes) else content.encode("utf-8", "replace")
        with part.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
        sync_folder(path.parent)
    except OSError as error:
        raise StorageError(f"{path}: {explain_os_error(error, path.parent)}") from error
    finally:
        with suppress(OSError):  # the error that matters is the first one
            part.unlink(missing_ok=True)


def explain_os_error(error: OSError, folder: Path) -> str:
    """Return an error of writing into `folder` in words, with advice."""
    if error.errno == errno.ENOSPC:
        return disk_full(folder)
    if error.errno in _FORBIDDEN:
        return (
            f"cannot be written ({error.strerror}): look at the folder's permissions and its disk"
        )
    if error.errno == errno.ENOENT and not folder.exists():
        return f"cannot be written: {folder} is no longer there"
    return f"cannot be written ({error.strerror}): look at the disk"


def disk_full(folder: Path) -> str:
    """Return the message for a full disk, with the space that is free."""
    free_mb = shutil.disk_usage(folder).free / 1e6
    return f"the disk is full ({free_mb:.1f} MB free): make room on it"


def sync_folder(folder: Path) -> None:
    """Flush the names in a folder to disk: a file that was synced may still lack its name."""
    number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(number)
    finally:
        os.close(number)


def make_folder(folder: Path) -> None:
    """Make a folder and its missing parents, their names flushed to disk. Raises `OSError`."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for path in missing:
        sync_folder(path.parent)


def read_file(path: Path, most_bytes: int, *, pipe: bool = False) -> bytes:
    """Read a file, up to one byte more than `most_bytes`; `pipe` allows a named pipe, too.

    The path may come from an untrusted file. Reading a device or a pipe can block for ever, and
    opening some devices has effects, so both are refused unopened. Raises `OSError`, and
    `ValueError` for an impossible path.
    """
    mode = path.stat().st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode) or (pipe and stat.S_ISFIFO(mode))):
        raise OSError(errno.EINVAL, "it is a device, a pipe or a socket, not a file")
    with path.open("rb") as file:
        return file.read(most_bytes + 1)
