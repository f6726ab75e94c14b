"""Another program that holds the write lock of a record, like a table editor with unsaved changes.

As a program, `python -m tests.support.storage.holder FILE`: holds it until standard input ends.
"""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.support.paths import ROOT

COMMAND = [sys.executable, "-m", "tests.support.storage.holder"]


class Holder:
    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process, self.pid = process, process.pid

    def release(self) -> None:
        """Undo the change and end."""
        assert self._process.stdin is not None
        self._process.stdin.close()


@contextmanager
def held(file: Path, pragma: str = "") -> Iterator[Holder]:
    """Have a process of its own hold the lock; `pragma` is executed first."""
    with subprocess.Popen(
        [*COMMAND, str(file), pragma], cwd=ROOT, text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        holder = Holder(process)
        try:
            yield holder
        finally:
            holder.release()


def main() -> None:
    database = sqlite3.connect(sys.argv[1], isolation_level=None)
    if sys.argv[2]:
        database.execute(sys.argv[2])
    database.execute("BEGIN IMMEDIATE")
    sys.stdout.write("held\n")
    sys.stdout.flush()
    sys.stdin.read()
    database.close()


if __name__ == "__main__":
    main()
