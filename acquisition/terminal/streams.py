"""Standard streams that never end a command: unknown characters are replaced, lost readers ignored.

A terminal may be closed, a pipe's reader may end, a console may know ASCII only. None of this is a
fault of the scan or of the fit: the command goes on and exits as it would have.
"""

from __future__ import annotations

import codecs
import errno
import io
import os
import re
import select
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TextIO
from unicodedata import combining, normalize

from instrument.errors import StorageError

if TYPE_CHECKING:
    from typing_extensions import Buffer

HANDLER = "gonio.replace"
"""Name of the error handler for `str.encode` that writes unknown characters in others."""

PATIENCE_S = 2.0  # then text for standard error is dropped: a stalled terminal stalls no scan
_GONE = frozenset({errno.EPIPE, errno.EIO, errno.EBADF, errno.ENXIO, errno.ECONNRESET})
_TICK_MS = 100
_CHUNK = select.PIPE_BUF  # a descriptor that is ready takes so many bytes without waiting

_IN_ASCII = {
    "±": "+/-", "°": "deg", "→": "->", "×": "x", "·": "*", "…": "...", "–": "-", "—": "-",
    "−": "-", "✗": "x", "µ": "u", "μ": "u", "α": "alpha", "Δ": "d", "θ": "theta", "σ": "sigma",
    "φ": "phi", "χ": "chi", "ϱ": "rho", "ρ": "rho", "≤": "<=", "≥": ">=", "“": '"', "”": '"',
    "‘": "'", "’": "'", "─": "-", "│": "|", "✓": "+",
}  # fmt: skip
_EXPONENT = re.compile("[⁺⁻⁰¹²³⁴-⁹]+")


def in_ascii(error: UnicodeError) -> tuple[str, int]:
    """Return readable ASCII for the characters that an encoding lacks: `+/-` for ±, `?` for none.

    An error handler of `codecs`, registered as HANDLER.
    """
    if not isinstance(error, UnicodeEncodeError):
        raise error
    unknown = _EXPONENT.sub(_exponent_in_ascii, error.object[error.start : error.end])
    return "".join(map(_letter_in_ascii, unknown)), error.end


def _exponent_in_ascii(found: re.Match[str]) -> str:
    return "^" + normalize("NFKD", found[0]).replace("−", "-")


def _letter_in_ascii(letter: str) -> str:
    """Return a letter without its accents, or its name; `?` for one that has neither."""
    plain = "".join(c for c in normalize("NFKD", letter) if not combining(c))
    return letter if letter.isascii() else _IN_ASCII.get(letter, plain if plain.isascii() else "?")


codecs.register_error(HANDLER, in_ascii)


class _LastingFile(io.FileIO):
    """Output file that drops its text once nobody reads it any more.

    patience_s: longest wait for a reader, after which text is dropped until it reads again; no
    error is raised at all. None waits for ever, and raises `StorageError` for a full disk.
    """

    def __init__(self, descriptor: int, patience_s: float | None) -> None:
        super().__init__(descriptor, "w", closefd=False)
        self._patience_s = patience_s
        self._stalled = self._lost = False

    def write(self, data: Buffer, /) -> int:
        """Write the bytes or drop them; return their number."""
        left = memoryview(data).cast("B")
        size = len(left)
        try:
            while left and not self._lost and self._is_ready():
                left = left[super().write(left[:_CHUNK]) or 0 :]
        except BaseException as error:
            # Or a flush at the end would fail, or wait for ever, once more.
            self._lost = self._patience_s is None or isinstance(error, OSError)
            if not isinstance(error, OSError):
                raise
            if self._patience_s is None and error.errno not in _GONE:
                raise StorageError(f"standard output: cannot be written: {error}") from error
        return size

    def _is_ready(self) -> bool:
        """Wait for the reader; one that let a wait pass is not waited for until it reads again."""
        poll = select.poll()
        poll.register(self.fileno(), select.POLLOUT)
        if self._patience_s is None:
            while not poll.poll(_TICK_MS):  # a signal just before a wait would not end it
                pass
            return True
        self._stalled = not poll.poll(0 if self._stalled else 1e3 * self._patience_s)
        return not self._stalled


@contextmanager
def lasting_streams() -> Iterator[None]:
    """Give the process standard streams that last, in a `with` block; closed ones lead nowhere."""
    before = sys.stdin, sys.stdout, sys.stderr
    with ExitStack() as opened:
        _occupy_standard_descriptors()
        sys.stdin = sys.stdin or opened.enter_context(Path(os.devnull).open(encoding="utf-8"))
        sys.stdout = _lasting(sys.stdout, 1, None)
        sys.stderr = _lasting(sys.stderr, 2, PATIENCE_S)
        try:
            yield
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            sys.stdin, sys.stdout, sys.stderr = before


def _occupy_standard_descriptors() -> None:
    """Open closed standard descriptors to nowhere, else a run's files would take their numbers."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest free number: this one


def _lasting(stream: TextIO | None, number: int, patience_s: float | None) -> io.TextIOWrapper:
    """Return a text stream in the same encoding on the descriptor of `stream`."""
    if stream is not None:
        stream.flush()
    descriptor = number if stream is None else stream.fileno()
    return io.TextIOWrapper(
        io.BufferedWriter(_LastingFile(descriptor, patience_s)),
        encoding=getattr(stream, "encoding", None) or "utf-8",
        errors=HANDLER,
        line_buffering=True,
    )
