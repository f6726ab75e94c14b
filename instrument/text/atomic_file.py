"""Files: written whole or not at all, read only where they are files; what a refusal means."""

from __future__ import annotations

import errno
import os
import shutil
import stat
from pathlib import Path

from instrument.errors import StorageError

_FORBIDDEN = (errno.EROFS, errno.EACCES, errno.EPERM)


def write_whole(path: Path, content: str | bytes) -> None:
    """Write bytes, or text as UTF-8, under a temporary name, flush it to disk, then rename it.

    A reader of `path` sees the old file or the whole new one, never a part, after a power cut too.
    Raises `StorageError`.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.unlink(missing_ok=True)  # whatever stands there may lead elsewhere
        data = content if isinstance(content, bytes) else content.encode("utf-8", "replace")
        with part.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
        sync_folder(path.parent)
    except OSError as error:
        raise StorageError(f"{path}: {trouble(error, path.parent)}") from error
    finally:
        _forget(part)


def _forget(part: Path) -> None:
    try:
        part.unlink(missing_ok=True)
    except OSError:
        return  # the disk takes no change at all: what it refused first is what counts


def trouble(error: OSError, folder: Path) -> str:
    """What a disk met, in words, and what to do about it."""
    if error.errno == errno.ENOSPC:
        return full(folder)
    if error.errno in _FORBIDDEN:
        return (
            f"cannot be written ({error.strerror}): look at the folder's permissions and its disk"
        )
    if error.errno == errno.ENOENT and not folder.exists():
        return f"cannot be written: {folder} is no longer there"
    return f"cannot be written ({error.strerror}): look at the disk"


def full(folder: Path) -> str:
    """A disk that is full, in words."""
    free_mb = shutil.disk_usage(folder).free / 1e6
    return f"the disk is full ({free_mb:.1f} MB free): make room on it"


def sync_folder(folder: Path) -> None:
    """Have the names in a folder on disk: a file that was synced may still lack its name."""
    number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(number)
    finally:
        os.close(number)


def make_folder(folder: Path) -> None:
    """Make a folder and those above it, each of their names on disk. Raises `OSError`."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for path in missing:
        sync_folder(path.parent)


def read_file(path: Path, most_bytes: int, *, pipe: bool = False) -> bytes:
    """What a file holds, up to one byte more than `most_bytes`; `pipe`: it may be a pipe, too.

    A path may come from a stranger. A device or a pipe would be waited for, perhaps for ever, and
    opening some devices does something by itself: they are refused unopened. Raises `OSError`, and
    `ValueError` for a path that can be none.
    """
    mode = path.stat().st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode) or (pipe and stat.S_ISFIFO(mode))):
        raise OSError(errno.EINVAL, "it is no file but a device, a pipe or a socket")
    with path.open("rb") as file:
        return file.read(most_bytes + 1)
