"""Simulated disk after a power cut, from a log of the write recorder.

Only synced data are certain: of a file, what was written before its last fsync; of a folder, the
names at its last fsync. Other writes may be present or missing in any order, and torn at a sector.
(POSIX fsync; stronger guarantees of some file systems are not used.)
"""

from __future__ import annotations

import random
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

_HEAD = struct.Struct("<6q")
CREATE, WRITE, TRUNCATE, SYNC, SYNC_FOLDER, RENAME, UNLINK, MAKE_FOLDER, MARK = range(1, 10)
SECTOR = 512


@dataclass(frozen=True, slots=True)
class Entry:
    """One file operation; `number` is an inode, or the number of a mark."""

    kind: int
    number: int
    offset: int
    length: int
    paths: tuple[str, ...]
    data: bytes


def entries(log: Path) -> Iterator[Entry]:
    """Yield all entries of a log, in order."""
    data, at = log.read_bytes(), 0
    while at < len(data):
        kind, number, offset, length, path_size, size = _HEAD.unpack_from(data, at)
        at += _HEAD.size
        paths = data[at : at + path_size].decode().split("\n")
        at += path_size
        yield Entry(kind, number, offset, length, tuple(paths), data[at : at + size])
        at += size


@dataclass
class _File:
    synced: bytes = b""
    pending: list[Entry] = field(default_factory=list)


def _applied(content: bytes, entry: Entry) -> bytes:
    if entry.kind == TRUNCATE:
        return content[: entry.length].ljust(entry.length, b"\0")
    content = content.ljust(entry.offset, b"\0")
    return content[: entry.offset] + entry.data + content[entry.offset + len(entry.data) :]


class Disk:
    """Disk that separates synced from unsynced data."""

    def __init__(self) -> None:
        self._files: list[_File] = [_File()]
        self._of_inode: dict[int, int] = {}  # inode numbers are reused after removal
        self._names: dict[str, int] = {}  # as the process sees them; a folder is 0
        self._synced: dict[str, int] = {}
        self._changes: dict[str, list[tuple[str, int | None]]] = {}  # by folder, not yet synced
        self.accepted: set[int] = set()

    def do(self, entry: Entry) -> None:
        """Apply the next entry of the log."""
        if entry.kind == MARK:
            self.accepted.add(entry.number)
        elif entry.kind in (WRITE, TRUNCATE):
            self._files[self._of_inode[entry.number]].pending.append(entry)
        elif entry.kind == SYNC:
            file = self._files[self._of_inode[entry.number]]
            for earlier in file.pending:
                file.synced = _applied(file.synced, earlier)
            file.pending.clear()
        elif entry.kind == SYNC_FOLDER:
            for name, number in self._changes.pop(entry.paths[0], []):
                _name(self._synced, name, number)
        else:
            self._rename(entry)

    def _rename(self, entry: Entry) -> None:
        path = entry.paths[0]
        if entry.kind == CREATE:
            self._of_inode[entry.number] = len(self._files)
            self._files.append(_File())
        changes: list[tuple[str, int | None]] = {
            CREATE: [(path, len(self._files) - 1)],
            MAKE_FOLDER: [(path, 0)],
            UNLINK: [(path, None)],
            RENAME: [(entry.paths[-1], self._names.get(path)), (path, None)],
        }[entry.kind]
        for name, number in changes:
            _name(self._names, name, number)
            self._changes.setdefault(str(Path(name).parent), []).append((name, number))

    def cut(self, folder: Path, root: str, draw: random.Random | None) -> None:
        """Write into a folder the synced data and, with `draw`, a random part of the rest."""
        names = dict(self._synced)
        for changes in self._changes.values():
            kept = draw.randint(0, len(changes)) if draw else 0
            for name, number in changes[:kept]:
                _name(names, name, number)
        for name in sorted(names):
            path = folder / Path(name).relative_to(root)
            above = [str(p) for p in Path(name).parents if len(str(p)) > len(root)]
            if any(names.get(p) != 0 for p in above):
                continue  # lost together with its folder
            if names[name] == 0:
                path.mkdir()
            else:
                path.write_bytes(self._left(names[name], draw))

    def _left(self, number: int, draw: random.Random | None) -> bytes:
        file = self._files[number]
        content = file.synced
        for entry in file.pending if draw else ():
            assert draw is not None
            if draw.random() < 0.5:
                continue
            size = len(entry.data)
            if entry.kind == WRITE and draw.random() < 0.3:
                size = min(size, draw.randrange(0, size + SECTOR, SECTOR))
            torn = Entry(
                entry.kind, entry.number, entry.offset, entry.length, (), entry.data[:size]
            )
            content = _applied(content, torn)
        return content


def _name(names: dict[str, int], name: str, number: int | None) -> None:
    if number is None:
        names.pop(name, None)
    else:
        names[name] = number
