"""Text files of measurements: reading lines and numbers, and collecting mistakes by position.

Mistakes are noted as they are found and raised together, as `file:line:column: what was found; what
is allowed`. Lines and columns count from 1, columns in characters.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from instrument.errors import InputError
from instrument.text.atomic_file import read_file
from instrument.text.file_kind import foreign_kind
from instrument.text.quoting import printable, shown

MAX_BYTES = 64 * 1024**2  # about 150 000 rows of a run's measurements.csv
MAX_LINES = 2_000_000
MAX_LINE = 1024**2  # characters; a thousand columns need about 20 000
MAX_REPORTED = 20
MAX_ALIKE = 3  # mistakes of one kind that are listed: an export repeats them in every row
MAX_NOTED = 10_000  # with more mistakes the rest of the file is not read


@dataclass(slots=True)
class TextFile:
    """Name and lines of a file, and the mistakes found so far: line, column and text."""

    name: str
    lines: list[str]
    mistakes: list[tuple[int, int, str]] = field(default_factory=list)

    def rows(self) -> Iterator[tuple[int, str]]:
        """Number and text of every line that is not blank and does not begin with #."""
        for line, text in enumerate(self.lines, start=1):
            if text.strip() and not text.startswith("#"):
                yield line, text

    def note(self, line: int, column: int, text: str) -> None:
        """Note a mistake; raises `InputError` with all so far when there are MAX_NOTED."""
        self.mistakes.append((line, column, text))
        if len(self.mistakes) >= MAX_NOTED:
            raise input_error(self)


def input_error(*files: TextFile) -> InputError:
    """Error that lists the mistakes of all files by position: MAX_ALIKE of a kind, then a count."""
    lines: list[str] = []
    more = Counter[str]()
    for file in files:
        seen: dict[str, list[str]] = {}
        for line, column, text in sorted(file.mistakes, key=lambda mistake: mistake[:2]):
            place, alike = f"{file.name}:{line}:{column}", seen.setdefault(_kind_of(text), [])
            if len(alike) < MAX_ALIKE and len(lines) < MAX_REPORTED:
                lines.append(f"{place}: {text}")
                alike.append(place)
            else:
                more[f"like {alike[-1]}" if alike else "of other kinds"] += 1
    least = "at least " if any(len(file.mistakes) >= MAX_NOTED for file in files) else ""
    tail = [f"... and {least}{count} more {words}" for words, count in more.most_common()]
    return InputError(*lines, *tail)


def _kind_of(text: str) -> str:
    """Kind of a mistake: its column, and what is allowed there, whatever the numbers."""
    return re.sub(r"[0-9]+", "0", f"{text.partition(':')[0]}{text.rpartition('allowed:')[2]}")


def read_text(path: Path, *, pipe: bool = False) -> TextFile:
    """Read a UTF-8 file (with or without a byte order mark, lines ending in LF, CRLF or CR).

    `pipe` allows a pipe. Raises `InputError` for a file that cannot be opened, is of another kind
    (a workbook, a web page), is not UTF-8 text, or exceeds MAX_BYTES, MAX_LINES or MAX_LINE.
    """
    name = printable(str(path))
    raw = _bytes(path, name, pipe).removeprefix(b"\xef\xbb\xbf")
    kind = foreign_kind(raw)
    if kind is not None:
        raise InputError(
            f"{name}:1:1: is {kind.name}; allowed: a table as text (CSV); {kind.advice}"
        )
    count = 1 + raw.count(b"\n") + raw.count(b"\r") - raw.count(b"\r\n")
    if count > MAX_LINES:
        raise InputError(f"{name}: {count} lines; allowed: {MAX_LINES}; split it")
    try:
        return _with_short_lines(TextFile(name, _lines(raw)))
    except UnicodeDecodeError as error:
        before = _lines(raw[: error.start])
        file = TextFile(name, before)
        byte = f"byte 0x{raw[error.start]:02x} is not UTF-8 text"
        file.note(len(before), len(before[-1]) + 1, f"{byte}; save the file as UTF-8")
        raise input_error(file) from None


def _with_short_lines(file: TextFile) -> TextFile:
    if max(map(len, file.lines)) <= MAX_LINE:
        return file
    line, text = next((n, own) for n, own in enumerate(file.lines, 1) if len(own) > MAX_LINE)
    file.note(line, 1, f"a line of {len(text)} characters; allowed: {MAX_LINE}")
    raise input_error(file)


def _bytes(path: Path, name: str, pipe: bool) -> bytes:
    try:
        raw = read_file(path, MAX_BYTES, pipe=pipe)
    except FileNotFoundError:
        raise InputError(f"{name}: no such file; check its name and folder") from None
    except IsADirectoryError:
        raise InputError(f"{name}: is a folder; allowed: a text file") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        problem = f"cannot be read: {reason}; check its name and permissions"
        raise InputError(f"{name}: {problem}") from None
    if len(raw) > MAX_BYTES:
        allowed = f"{MAX_BYTES // 1024**2} MB"
        raise InputError(f"{name}: the file is too large; allowed: {allowed}; split it")
    return raw


def _lines(raw: bytes) -> list[str]:
    # str.splitlines would also split at form feeds and the like, which editors do not count.
    return raw.decode().replace("\r\n", "\n").replace("\r", "\n").split("\n")


def parse_number(text: str) -> float:
    """Parse a finite number in Python's notation, without underscores.

    Raises `ValueError` with a description of the text found instead.
    """
    text = text.strip()
    if not text:
        raise ValueError("is empty")
    try:
        value = float(text.replace("_", "?"))  # Python itself accepts 1_000
    except ValueError:
        raise ValueError(f"{shown(text)} is text") from None
    if not math.isfinite(value):
        raise ValueError(f"{shown(text)} is not finite")
    return value
