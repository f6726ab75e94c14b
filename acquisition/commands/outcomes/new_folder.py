"""Folder for files of an outcome: a new or an empty one, so that nothing is replaced."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from instrument.errors import InputError, StorageError
from instrument.text.atomic_file import explain_os_error, write_whole


def require_new_folder(folder: Path, option: str) -> None:
    """Raise `InputError` unless the folder is empty, or can be made: nothing is replaced."""
    if folder.is_dir():
        if next(folder.iterdir(), None) is not None:
            raise InputError(f"{option} {folder}: is not empty: name a new folder")
    elif folder.exists() or folder.is_symlink():
        raise InputError(f"{option} {folder}: is no folder: name a new one")
    elif not folder.parent.is_dir():
        raise InputError(f"{option} {folder}: there is no folder {folder.parent}: make it first")


def write_files(folder: Path, files: Mapping[str, str | bytes]) -> None:
    """Write the files by name into the folder; raises `StorageError` where the disk fails."""
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise StorageError(f"{folder}: {explain_os_error(error, folder.parent)}") from error
    for name, content in files.items():
        write_whole(folder / name, content, new=True)
