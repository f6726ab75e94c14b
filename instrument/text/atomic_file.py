"""Atomic, durable writing of files; bounded reading; errors of the disk in words."""

from __future__ import annotations

import errno
import os
import shutil
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from instrument.errors import InputError, StorageError

_FORBIDDEN = (errno.EROFS, errno.EACCES, errno.EPERM)
_NO_LINKS = (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK)


def write_whole(
    path: Path, content: str | bytes, *, linked_folder: bool = True, new: bool = False
) -> None:
    """Write bytes, or text as UTF-8, under a temporary name, flush to disk, then rename.

    A reader of `path` sees the old file or the whole new one, also after a power cut. A link under
    the file's name is replaced; `linked_folder`: its folder may be a link. `new`: nothing that
    bears this name is replaced. Raises `StorageError`, and `InputError` for a name that is taken.
    """
    data = content if isinstance(content, bytes) else content.encode("utf-8", "replace")
    follow = 0 if linked_folder else os.O_NOFOLLOW
    try:
        folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY | follow)
        try:
            _write_in(folder, path.name, data, _link_new if new else _rename)
        finally:
            os.close(folder)
    except FileExistsError:
        raise InputError(f"{path}: exists already: choose another name") from None
    except OSError as error:
        raise StorageError(f"{path}: {explain_os_error(error, path.parent)}") from error


def _rename(part: str, name: str, folder: int) -> None:
    os.replace(part, name, src_dir_fd=folder, dst_dir_fd=folder)


def _link_new(part: str, name: str, folder: int) -> None:
    """Give a file its name, unless that is taken: a link, unlike a rename, replaces nothing."""
    try:
        os.link(part, name, src_dir_fd=folder, dst_dir_fd=folder, follow_symlinks=False)
    except OSError as error:
        if error.errno not in _NO_LINKS:
            raise
        # A disk without hard links, such as a memory card's: the name is taken by an empty file.
        os.close(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666, dir_fd=folder))
        _rename(part, name, folder)


def _write_in(
    folder: int, name: str, data: bytes, give_name: Callable[[str, str, int], None]
) -> None:
    """Write a file of an open folder, which stays the same whatever happens to its path."""
    part = f".{name}.{os.getpid()}.part"
    try:
        with suppress(FileNotFoundError):
            os.unlink(part, dir_fd=folder)  # it may be a link to another file
        create = os.O_WRONLY | os.O_CREAT | os.O_EXCL
        with os.fdopen(os.open(part, create, 0o666, dir_fd=folder), "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        give_name(part, name, folder)
        os.fsync(folder)
    finally:
        with suppress(OSError):  # the error that matters is the first one
            os.unlink(part, dir_fd=folder)


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
