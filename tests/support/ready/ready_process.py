"""Calls in processes of their own that need not import anything: forks of one that has done so.

For tests whose subject belongs to a process, such as its signals or a preloaded library. The fork
has no threads and no terminal; it ends as a process does that was started with `python -m`. Its
reports have no charts.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from instrument.closeable import Closeable
from tests.support.paths import ROOT

COMMAND = "acquisition.entry:main"
COMMAND_MODULES = (
    "acquisition.cli", "acquisition.commands.scan", "acquisition.commands.setup",
    "acquisition.results.finish", "analysis.report.page",
)  # fmt: skip
PATIENCE_S = 120.0


class ReadyProcess(Closeable):
    """Process that has imported the modules, for any number of calls one after the other.

    call: "module:function", without arguments, which reads `sys.argv`. environment: further
    variables of the process.
    """

    def __init__(
        self,
        call: str = COMMAND,
        modules: Sequence[str] = COMMAND_MODULES,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        ours, theirs = socket.socketpair()
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.support.ready.server", str(theirs.fileno()), call,
             *modules],
            env=os.environ | dict(environment or {}), cwd=ROOT, pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
        )  # fmt: skip
        theirs.close()
        self._pipe = Connection(ours.detach())
        self._folder = tempfile.TemporaryDirectory()
        self._arguments: tuple[str, ...] = ()
        self._running: int | None = None

    def close(self) -> None:
        """End the process; may be called twice."""
        self._pipe.close()
        self._process.wait(PATIENCE_S)
        self._folder.cleanup()

    def start(self, *arguments: object, **environment: str) -> int:
        """Start a call with these arguments and further variables; return its process number.

        A call that a failed test has left behind is ended first.
        """
        if self._running is not None:
            with suppress(ProcessLookupError):
                os.kill(self._running, signal.SIGKILL)
            self.finish()
        self._arguments = tuple(map(str, arguments))
        self._pipe.send((self._arguments, environment, self._folder.name))
        self._running = int(self._answer())
        return self._running

    def has_ended(self) -> bool:
        """Return True once the call has ended, of which `finish` tells the outcome."""
        return self._pipe.poll()

    def finish(self) -> subprocess.CompletedProcess[str]:
        """Wait for the end of the call."""
        code, self._running = self._answer(), None
        out, err = (Path(self._folder.name, name).read_text() for name in ("out", "err"))
        return subprocess.CompletedProcess(self._arguments, code, out, err)

    def run(self, *arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
        """Make a call and wait for its end."""
        self.start(*arguments, **environment)
        return self.finish()

    def _answer(self) -> Any:
        if not self._pipe.poll(PATIENCE_S):
            raise TimeoutError(f"{self._arguments}: no answer for {PATIENCE_S} s")
        return self._pipe.recv()
