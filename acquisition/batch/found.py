"""Runs and tables in a folder and the folders in it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from instrument.errors import InputError
from instrument.record.record import FILE_NAME
from instrument.text.quoting import printable

TABLES = (".csv", ".astm", ".alta", ".bsdf", ".binary")
"""Endings of files that are tables, in any case; `.pab` files of one folder are one table."""
_SIDE_FILE = ".u.csv"  # uncertainties that `gonio export` writes beside a file of another program
_PAB = ".pab"


@dataclass(frozen=True, slots=True)
class Found:
    """Sources in a folder by their name, sorted; `others`: names of files that are none.

    A name is the path from the folder, with `/`.
    """

    sources: dict[str, Path]
    others: tuple[str, ...]


def sources_in(folder: Path) -> Found:
    """Find runs (folders with a record) and tables (files by their ending) in a folder.

    Nothing is searched in a run, in hidden folders or behind links to folders. Raises `InputError`
    for a folder that is missing, is a run itself, or holds neither.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; name the one that holds runs and tables")
    if (folder / FILE_NAME).is_file():
        raise InputError(f"{folder}: is one run: gonio fit {folder}, without --all")
    walked = list(_walk(folder))
    named = {_name(path, folder): path for path, is_source in walked if is_source}
    if not named:
        raise InputError(
            f"{folder}: holds no run, which is a folder with {FILE_NAME}, and no table, which is a "
            f"file {', '.join(f'*{ending}' for ending in TABLES)} or a folder of *{_PAB} files"
        )
    others = sorted(_name(path, folder) for path, is_source in walked if not is_source)
    return Found(dict(sorted(named.items())), tuple(others))


def _name(path: Path, folder: Path) -> str:
    relative = path.relative_to(folder)
    return printable(relative.as_posix() if relative.parts else folder.resolve().name)


def _walk(folder: Path) -> Iterator[tuple[Path, bool]]:
    """Yield sources, with True, and other files, with False."""
    inside = [path for path in folder.iterdir() if not path.name.startswith(".")]
    if any(path.suffix == _PAB for path in inside):
        yield folder, True
    for path in inside:
        if (path / FILE_NAME).is_file():
            yield path, True
        elif path.is_dir():
            if not path.is_symlink():
                yield from _walk(path)
        elif path.suffix != _PAB:
            yield path, _is_table(path)


def _is_table(path: Path) -> bool:
    name = path.name.lower()
    return name.endswith(TABLES) and not name.endswith(_SIDE_FILE)
