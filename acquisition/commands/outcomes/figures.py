"""Figures of a report as files of their own: SVG, and their data as CSV."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from instrument.errors import InputError, StorageError
from instrument.text.atomic_file import explain_os_error, write_whole


def require_new_folder(folder: Path) -> None:
    """Raise `InputError` unless the folder is empty, or can be made: nothing is replaced."""
    if folder.is_dir():
        if next(folder.iterdir(), None) is not None:
            raise InputError(f"--figures {folder}: is not empty: name a new folder")
    elif folder.exists() or folder.is_symlink():
        raise InputError(f"--figures {folder}: is no folder: name a new one")
    elif not folder.parent.is_dir():
        raise InputError(f"--figures {folder}: there is no folder {folder.parent}: make it first")


def write_figures(folder: Path, files: Mapping[str, str]) -> str:
    """Write the files into the folder and return a line that says so.

    Raises `StorageError` where the disk fails.
    """
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise StorageError(f"{folder}: {explain_os_error(error, folder.parent)}") from error
    for name, content in files.items():
        write_whole(folder / name, content, new=True)
    return f"figures: {len(files)} files in {folder}" if files else "figures: no value to draw"
