"""The command `gonio`, in the test's own process (`gonio_here`) or in one of its own (`gonio`).

`gonio_here` calls the same entry point and saves a second of imports: use it for what the command
prints and writes. Signals, a terminal, whose modules are found and the preloaded library of the
emulated camera belong to a process and need `gonio`.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from io import TextIOWrapper
from pathlib import Path
from typing import IO, NoReturn
from unittest.mock import patch

from typer.main import get_command

from acquisition.entry import main
from tests.support.paths import ROOT

# The tree of commands, which takes ten times as long to build as to read the arguments of one.
_built_once = cache(get_command)
_stop_thread_fd = [-1]  # its end of the pipe, once a command has started the thread


def gonio(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the command from the project's folder, without a terminal."""
    return subprocess.run(
        [sys.executable, "-m", "acquisition", *map(str, arguments)],
        cwd=ROOT, capture_output=True, text=True, timeout=300, check=False,
        stdin=subprocess.DEVNULL,
    )  # fmt: skip


def finished_run(protocol: Path, run: Path) -> Path:
    """Run a protocol into the folder `run`, and return it; fail if the scan fails."""
    done = gonio_here("run", protocol, "--out", run)
    assert done.returncode == 0, done.stderr
    return run


def gonio_here(
    *arguments: object, cwd: Path | None = None, encoding: str = "utf-8"
) -> subprocess.CompletedProcess[str]:
    """Run the command without a terminal; the output of its child processes is captured too.

    `encoding` of its standard streams, as a terminal's.
    """
    with contextlib.ExitStack() as stack:
        stack.enter_context(_told_end())
        stack.enter_context(contextlib.chdir(cwd or Path.cwd()))
        nobody = stack.enter_context(Path(os.devnull).open())
        out, err = (stack.enter_context(tempfile.TemporaryFile()) for _ in range(2))
        stack.enter_context(_standing_for(0, nobody))
        stack.enter_context(_standing_for(1, out))
        stack.enter_context(_standing_for(2, err))
        stdout, stderr = (stack.enter_context(_text(n, encoding)) for n in (1, 2))
        stack.enter_context(patch.multiple(sys, stdin=nobody, stdout=stdout, stderr=stderr))
        stack.enter_context(patch.object(sys, "argv", ["gonio", *map(str, arguments)]))
        stack.enter_context(patch("typer.main.get_command", _built_once))
        stack.enter_context(patch.dict(os.environ))
        stack.enter_context(own_signals())
        code = _exit_code()
        stdout.flush()
        stderr.flush()
        texts = (_read(file, encoding) for file in (out, err))
        return subprocess.CompletedProcess(arguments, code, *texts)


def _exit_code() -> int:
    """Exit code of the command; any exception but `SystemExit` fails the test."""
    try:
        main()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


@contextlib.contextmanager
def _told_end() -> Iterator[None]:
    """Show where a command ends the process, and with it the tests: on the tests' own stderr."""
    end = os._exit
    with os.fdopen(os.dup(2), "w") as stderr:

        def told_end(code: int) -> NoReturn:
            faulthandler.dump_traceback(stderr, all_threads=True)
            end(code)

        with patch("os._exit", told_end):
            yield


@contextlib.contextmanager
def _standing_for(number: int, file: IO[str] | IO[bytes]) -> Iterator[None]:
    """Replace a standard descriptor of the process, which children inherit, by the file."""
    kept = os.dup(number)
    os.dup2(file.fileno(), number)
    try:
        yield
    finally:
        os.dup2(kept, number)
        os.close(kept)


def _text(number: int, encoding: str) -> TextIOWrapper:
    """Line-buffered text stream on the descriptor, like Python's own."""
    return open(number, "w", buffering=1, encoding=encoding, closefd=False)


@contextlib.contextmanager
def own_signals() -> Iterator[None]:
    """Restore the handlers that the command replaces, and keep its stop thread to the command.

    That thread would take two signals of other tests for those of a command that hangs.
    """
    stops = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
    before = {number: signal.getsignal(number) for number in stops}
    signal.set_wakeup_fd(_stop_thread_fd[0], warn_on_full_buffer=False)
    try:
        with patch.object(sys, "unraisablehook", sys.unraisablehook):
            yield
    finally:
        _stop_thread_fd[0] = max(signal.set_wakeup_fd(-1), _stop_thread_fd[0])
        for number, handler in before.items():
            signal.signal(number, handler)


def _read(file: IO[bytes], encoding: str) -> str:
    file.seek(0)
    return file.read().decode(encoding)
