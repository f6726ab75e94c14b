"""Lock on the folder of a run, against a second process that scans into it.

It is a lock on the folder itself: there is no file that could be removed, and it ends with the
process. It holds on one computer; a record on a network share is refused anyway.
"""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from instrument.closeable import Closeable
from instrument.errors import InputError
from instrument.processes import locking


class FolderLock(Closeable):
    """Lock on a folder, held until it is closed."""

    def __init__(self, folder: Path) -> None:
        """Take the lock at once, or raise `InputError` that names the process which holds it."""
        self._number = -1
        try:
            self._number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
            fcntl.flock(self._number, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if not os.path.samestat(os.fstat(self._number), folder.stat()):
                self.close()
                raise InputError(f"{folder}: was replaced by another folder just now: run again")
        except BlockingIOError as error:
            self.close()
            raise InputError(_held(folder)) from error
        except OSError as error:
            self.close()
            text = f"cannot be locked ({error.strerror}): look at the folder and its permissions"
            raise InputError(f"{folder}: {text}") from error

    def close(self) -> None:
        """Release the lock; may be called twice."""
        number, self._number = self._number, -1
        if number >= 0:
            os.close(number)


def _held(folder: Path) -> str:
    holder = next((f"process {pid}" for pid in locking(folder)), "another process")
    return f"{folder}: {holder} is scanning into this run: wait for its end, or stop it"
