"""The command `gonio`, in the test's own process (`gonio_here`) or in one of its own (`gonio`).

`gonio_here` calls the same entry point and saves a second of imports: use it for what the command
prints and writes. Signals, a terminal, whose modules are found and the preloaded library of the
emulated camera belong to a process and need `gonio`.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from io import TextIOWrapper
from pathlib import Path
from typing import IO
from unittest.mock import patch

from acquisition.cli import main
from tests.support.paths import ROOT


def gonio(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the command from the project's folder, with nobody at its terminal."""
    return subprocess.run(
        [sys.executable, "-m", "acquisition", *map(str, arguments)],
        cwd=ROOT, capture_output=True, text=True, timeout=300, check=False,
        stdin=subprocess.DEVNULL,
    )  # fmt: skip


def gonio_here(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command with nobody at its terminal; what its own child prints is caught as well."""
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.chdir(cwd or Path.cwd()))
        nobody = stack.enter_context(Path(os.devnull).open())
        out, err = (stack.enter_context(tempfile.TemporaryFile()) for _ in range(2))
        stack.enter_context(_standing_for(0, nobody))
        stack.enter_context(_standing_for(1, out))
        stack.enter_context(_standing_for(2, err))
        stdout, stderr = stack.enter_context(_text(1)), stack.enter_context(_text(2))
        stack.enter_context(patch.multiple(sys, stdin=nobody, stdout=stdout, stderr=stderr))
        stack.enter_context(patch.object(sys, "argv", ["gonio", *map(str, arguments)]))
        stack.enter_context(patch.dict(os.environ))
        stack.enter_context(_own_signals())
        code = _exit_code()
        stdout.flush()
        stderr.flush()
        return subprocess.CompletedProcess(arguments, code, _read(out), _read(err))


def _exit_code() -> int:
    """What the process would end with; anything but a `SystemExit` is the test's failure."""
    try:
        main()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


@contextlib.contextmanager
def _standing_for(number: int, file: IO[str] | IO[bytes]) -> Iterator[None]:
    """The file in place of one of the process's three descriptors, which children inherit."""
    kept = os.dup(number)
    os.dup2(file.fileno(), number)
    try:
        yield
    finally:
        os.dup2(kept, number)
        os.close(kept)


def _text(number: int) -> TextIOWrapper:
    """A writer like the one that Python opens on the descriptor; lines go out at once."""
    return open(number, "w", buffering=1, encoding="utf-8", closefd=False)


@contextlib.contextmanager
def _own_signals() -> Iterator[None]:
    """The command takes SIGINT and SIGTERM; the test runner gets them back."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _read(file: IO[bytes]) -> str:
    file.seek(0)
    return file.read().decode()
