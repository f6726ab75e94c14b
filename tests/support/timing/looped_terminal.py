"""Pseudo-terminal through which a thread exchanges bytes with itself, to learn how long they take.

An emulated serial port is a pseudo-terminal. The kernel carries its bytes in a thread of its own,
which waits for a processor as any other does (Linux, drivers/tty/tty_buffer.c: flush_to_ldisc).
"""

from __future__ import annotations

import fcntl
import os
import select
import tty
from contextlib import suppress

from instrument.closeable import Closeable

GIVEN_UP_S = 1.0


class LoopedTerminal(Closeable):
    """Both ends of a pseudo-terminal, controller and port; no driver can open the port as well."""

    def __init__(self) -> None:
        self.ends = controller, port = os.openpty()
        self._open = [controller, port]
        tty.setraw(port)
        with suppress(BlockingIOError):  # a driver that has lost this number tries it, and goes
            fcntl.flock(port, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def exchange(self) -> None:
        """Send a byte each way, as a question and its answer; return once both have arrived.

        A byte is given up after GIVEN_UP_S: the thread must end with its test.
        """
        for sender, receiver in (self.ends, reversed(self.ends)):
            os.write(sender, b"x")
            if select.select([receiver], [], [], GIVEN_UP_S)[0]:
                os.read(receiver, 64)

    def close(self) -> None:
        """Give the terminal back; may be called twice."""
        while self._open:
            os.close(self._open.pop())
