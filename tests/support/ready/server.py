"""The process itself: `python -m tests.support.ready.server PIPE CALL MODULE ...`.

Forks for each request (arguments, environment, folder), and answers with the number of the new
process, then with its exit code. Its output goes to the files `out` and `err` of the folder.
"""

from __future__ import annotations

import importlib
import os
import sys
from multiprocessing.connection import Connection
from pathlib import Path

from tests.support.analysis.no_charts import leave_charts_out


def main() -> None:
    """Serve requests until the pipe is closed; in a fork, return from the call."""
    pipe = Connection(int(sys.argv[1]))
    module, _, function = sys.argv[2].partition(":")
    for name in (*sys.argv[3:], module):
        importlib.import_module(name)
    leave_charts_out()
    while True:
        try:
            arguments, environment, folder = pipe.recv()
        except EOFError:
            return
        pid = os.fork()
        if pid == 0:
            _take_output(Path(folder))
            os.environ.update(environment)
            sys.argv = [sys.argv[0], *arguments]
            getattr(sys.modules[module], function)()
            return
        pipe.send(pid)
        pipe.send(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))


def _take_output(folder: Path) -> None:
    """Replace the standard descriptors, which the process's children inherit too, by files."""
    for number, name in ((1, "out"), (2, "err")):
        file = os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        os.dup2(file, number)
        os.close(file)


if __name__ == "__main__":
    main()
