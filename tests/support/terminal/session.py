"""Command at a terminal of its own, into which keys are typed."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import termios
import time
from collections.abc import Sequence

from instrument.closeable import Closeable
from tests.support.paths import ROOT
from tests.support.timing.deadline import DEADLINE_S

# The new session takes the terminal as its own, as a shell's login does.
_OWN_TERMINAL = (
    "import fcntl, os, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); "
    "os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"
)
_END = "\x00the end\x00"


class TerminalSession(Closeable):
    """Python with these arguments; `text`: all that it has written so far."""

    def __init__(self, arguments: Sequence[object]) -> None:
        self._terminal, slave = os.openpty()
        self.before = termios.tcgetattr(slave)
        self.text = ""
        self._process = subprocess.Popen(
            [sys.executable, "-c", _OWN_TERMINAL, *map(str, arguments)],
            cwd=ROOT, stdin=slave, stdout=slave, stderr=slave, start_new_session=True,
        )  # fmt: skip
        self._slave = slave  # stays open, so that its settings can be read in the end

    def close(self) -> None:
        """Kill the command if it still runs, and close its terminal."""
        self._process.kill()
        self._process.wait(DEADLINE_S)
        os.close(self._terminal)
        os.close(self._slave)

    @property
    def is_as_before(self) -> bool:
        """True if the terminal has the settings with which the command began."""
        return termios.tcgetattr(self._slave) == self.before

    def press(self, keys: str) -> None:
        """Press keys."""
        os.write(self._terminal, keys.encode())

    def read_until(self, text: str, deadline_s: float = DEADLINE_S) -> None:
        """Read until a text has come, anew since the last call; fail at the deadline."""
        seen, until_s = len(self.text), time.monotonic() + deadline_s
        while text not in self.text[seen:]:
            assert time.monotonic() < until_s, f"{text!r} has not come: {self.text!r}"
            self.look(0.1)

    def look(self, seconds: float) -> bool:
        """Read what is written within this time, at most once; return False if nothing was."""
        if not select.select([self._terminal], [], [], seconds)[0]:
            return False
        self.text += os.read(self._terminal, 65536).decode("utf-8", "replace")
        return True

    def wait(self, deadline_s: float = DEADLINE_S) -> int:
        """Return the exit code; all that was written until then has been read."""
        until_s = time.monotonic() + deadline_s
        while self._process.poll() is None:
            assert time.monotonic() < until_s, f"it runs on: {self.text!r}"
            self.look(0.01)
        os.write(self._slave, _END.encode())  # the kernel may still hold what came before it
        self.read_until(_END, deadline_s)
        self.text = self.text.replace(_END, "")
        return self._process.returncode
