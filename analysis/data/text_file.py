"""Text files of measurements: their lines, the numbers in them, and the place of every mistake.

Mistakes are noted as they are found and raised together, `file:line:column: what stands there;
what is allowed`; lines and columns count from 1, columns in characters.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from instrument.errors import InputError
from instrument.text.atomic_file import read_file
from instrument.text.quoting import printable, shown

MAX_BYTES = 64 * 1024**2  # some 400 000 rows of a run's measurements.csv
MAX_LINES = 2_000_000
MAX_LINE = 1024**2  # characters; a thousand columns need some 20 000
MAX_REPORTED = 20
MAX_NOTED = 10_000  # what is all wrong need not be read to its end


@dataclass(slots=True)
class TextFile:
    """A file's name and lines, the first of them line 1, and what is wrong with them so far."""

    name: str
    lines: list[str]
    mistakes: list[tuple[int, int, str]] = field(default_factory=list)

    def rows(self) -> Iterator[tuple[int, str]]:
        """Number and text of every line that is neither blank nor begins with #."""
        for line, text in enumerate(self.lines, start=1):
            if text.strip() and not text.startswith("#"):
                yield line, text

    def note(self, line: int, column: int, text: str) -> None:
        """Note a mistake; raises `InputError` with those so far when there are MAX_NOTED."""
        self.mistakes.append((line, column, text))
        if len(self.mistakes) >= MAX_NOTED:
            raise error_of(self)


def error_of(*files: TextFile) -> InputError:
    """The error that lists the mistakes of all files by place, the first MAX_REPORTED of them."""
    lines = [
        f"{file.name}:{line}:{column}: {text}"
        for file in files
        for line, column, text in sorted(file.mistakes, key=lambda mistake: mistake[:2])
    ]
    more = len(lines) - MAX_REPORTED
    least = "at least " if any(len(file.mistakes) >= MAX_NOTED for file in files) else ""
    tail = [f"... and {least}{more} more"] if more > 0 else []
    return InputError(*lines[:MAX_REPORTED], *tail)


def read_text(path: Path, *, pipe: bool = False) -> TextFile:
    """Read a UTF-8 file (with or without a byte order mark, lines ending in LF, CRLF or CR).

    `pipe`: it may be a pipe. Raises `InputError` for a file that cannot be opened, that is not
    UTF-8 text, or that is larger than MAX_BYTES, MAX_LINES or MAX_LINE.
    """
    name = printable(str(path))
    raw = _bytes(path, name, pipe).removeprefix(b"\xef\xbb\xbf")
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
        raise error_of(file) from None


def _with_short_lines(file: TextFile) -> TextFile:
    for line, text in enumerate(file.lines, start=1):
        if len(text) > MAX_LINE:
            file.note(line, 1, f"a line of {len(text)} characters; allowed: {MAX_LINE}")
            raise error_of(file)
    return file


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
    # str.splitlines would also break lines at form feeds and the like, which editors do not count.
    return raw.decode().replace("\r\n", "\n").replace("\r", "\n").split("\n")


def number(text: str) -> float:
    """A finite number as Python writes it, without underscores.

    Raises `ValueError`, whose text says what stands there instead.
    """
    text = text.strip()
    if not text:
        raise ValueError("is empty")
    try:
        value = float(text.replace("_", "?"))  # Python itself would take 1_000
    except ValueError:
        raise ValueError(f"{shown(text)} is text") from None
    if not math.isfinite(value):
        raise ValueError(f"{shown(text)} is not finite")
    return value
