"""Runs and tables in a folder and the folders in it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from instrument.errors import InputError
from instrument.record.record import FILE_NAME
from instrument.text.quoting import printable

TABLES = (".csv", ".astm", ".alta", ".bsdf", ".binary")
"""Endings of files that are tables, in any case; `.pab` files of one folder are one table."""
_SIDE_FILE = ".u.csv"  # uncertainties that `gonio export` writes beside a file of another program
_PAB = ".pab"
_MOST_NAMED = 3  # of what is no source

Kind = Literal["run", "table", "other"]


@dataclass(frozen=True, slots=True)
class Found:
    """Sources in a folder by their name, sorted; `others`: names of what is none.

    A name is the path from the folder, with `/`.
    """

    sources: Mapping[str, Path]
    others: tuple[str, ...]


def sources_in(folder: Path) -> Found:
    """Find runs (folders with a record) and tables (files by their ending) in a folder.

    Nothing is searched in a run, in hidden folders or behind links to folders. Raises `InputError`
    for a folder that is missing, is a run itself, or holds neither.
    """
    _require_folder(folder, "fit", "runs and tables")
    named = dict(sorted(_named(folder)))
    found = {name: path for name, (path, kind) in named.items() if kind != "other"}
    if not found:
        raise InputError(
            f"{folder}: holds no run, which is a folder with {FILE_NAME}, and no table, which is a "
            f"file {', '.join(f'*{ending}' for ending in TABLES)} or a folder of *{_PAB} files"
        )
    return Found(found, tuple(name for name in named if name not in found))


def runs_in(folder: Path, command: str, has: Callable[[Path], bool], what: str) -> Found:
    """Find the runs in a folder, as `sources_in` does, that `has` accepts; `others`: other runs.

    command: that of `gonio` for one run. what: a run must have, in the words of an error. Raises
    `InputError` for a folder that is missing, is a run itself, or holds no such run.
    """
    _require_folder(folder, command, "runs")
    runs = {name: path for name, (path, kind) in sorted(_named(folder)) if kind == "run"}
    found = {name: path for name, path in runs.items() if has(path)}
    others = tuple(name for name in runs if name not in found)
    if not found:
        without = f"; without: {listed(others)}" if others else ""
        raise InputError(
            f"{folder}: holds no run, which is a folder with {FILE_NAME}, that has {what}{without}"
        )
    return Found(found, others)


def listed(names: Sequence[str]) -> str:
    """Return the first few names, and the number of the others."""
    more = len(names) - _MOST_NAMED
    return ", ".join(names[:_MOST_NAMED]) + f" and {more} more" * (more > 0)


def _require_folder(folder: Path, command: str, what: str) -> None:
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; name the one that holds {what}")
    if (folder / FILE_NAME).is_file():
        raise InputError(f"{folder}: is one run: gonio {command} {folder}, without --all")


def _named(folder: Path) -> Iterator[tuple[str, tuple[Path, Kind]]]:
    for path, kind in _walk(folder):
        relative = path.relative_to(folder)
        name = relative.as_posix() if relative.parts else folder.resolve().name
        yield printable(name), (path, kind)


def _walk(folder: Path) -> Iterator[tuple[Path, Kind]]:
    inside = [path for path in folder.iterdir() if not path.name.startswith(".")]
    if any(path.suffix == _PAB for path in inside):
        yield folder, "table"
    for path in inside:
        if (path / FILE_NAME).is_file():
            yield path, "run"
        elif path.is_dir():
            if not path.is_symlink():
                yield from _walk(path)
        elif path.suffix != _PAB:
            yield path, "table" if _is_table(path) else "other"


def _is_table(path: Path) -> bool:
    name = path.name.lower()
    return name.endswith(TABLES) and not name.endswith(_SIDE_FILE)
