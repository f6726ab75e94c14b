"""Thread that writes a record: who waits for its disk can be interrupted, and can give up.

A system call that waits for a disk cannot be interrupted. The record's connection belongs to this
thread while a write is under way, and to its caller otherwise.
"""

from __future__ import annotations

import math
import queue
import threading
import time
from collections.abc import Callable
from pathlib import Path

from instrument.errors import StorageError


class WriteThread:
    """Writes one after the other; begin none before the one before has ended.

    `path`: of the record, for messages.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._writes: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._idle = threading.Event()
        self._idle.set()
        self._error: BaseException | None = None
        self._thread: threading.Thread | None = None
        self._until_s = math.inf

    def run(self, write: Callable[[], None]) -> None:
        """Write, and wait for the end; a write that itself writes does so at once."""
        if threading.current_thread() is self._thread:
            write()
            return
        self.begin(write)
        self.wait()

    def begin(self, write: Callable[[], None]) -> None:
        """Begin a write, once the one before has ended; raise the error of that one."""
        self.wait()
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, name="record", daemon=True)
            self._thread.start()
        self._idle.clear()
        self._writes.put(write)

    def wait(self) -> None:
        """Wait until nothing is being written; raise the error of the last write, once.

        Raises `StorageError` after the time that `give_up_within` has set.
        """
        if threading.current_thread() is self._thread:
            return
        if not self._is_idle():
            raise StorageError(
                f"{self._path}: the last write has not ended: look at the disk, and at what else "
                "has the file open"
            )
        error, self._error = self._error, None
        if error is not None:
            raise error

    def _is_idle(self) -> bool:
        """Wait until nothing is being written; return False if the time for it is up."""
        left_s = max(self._until_s - time.monotonic(), 0.0)
        return self._idle.wait(min(left_s, threading.TIMEOUT_MAX))

    def give_up_within(self, limit_s: float) -> None:
        """Wait no longer than this, from now on, for all that is still written."""
        self._until_s = time.monotonic() + limit_s

    def end(self) -> bool:
        """End the thread once it has written; return False if it still writes, in vain."""
        if not self._is_idle():
            return False
        self._writes.put(None)
        return True

    def _work(self) -> None:
        while (write := self._writes.get()) is not None:
            try:
                write()
            except BaseException as error:  # noqa: BLE001 - handed over: `wait` raises it
                self._error = error
            self._idle.set()
