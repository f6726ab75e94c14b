"""What comes after the scan, made ready while it runs.

Loading the fit and the charts takes about a second. A second process does it while the rig is
busy, then waits for the word that the record is complete, and prints the outcome itself. When the
scan ends in any other way its input closes, and it ends without having touched the run.
"""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

from instrument.closeable import Closing
from instrument.errors import StorageError

GO = "go\n"  # the word that the record is complete


class Afterwards(Closing):
    """The waiting process; use it with `with`, and call `finish` once the record is complete."""

    def __init__(self, folder: Path, as_json: bool) -> None:
        form = "json" if as_json else "text"
        # -P: nothing in the folder that one happens to stand in is taken for the program.
        command = [sys.executable, "-P", "-m", "acquisition.finisher", str(folder), form]
        # A session of its own: Ctrl-C is the scan's business.
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, text=True, start_new_session=True
        )
        self._folder = folder

    def close(self) -> None:
        """Let it end, by itself where it was not asked to finish."""
        self._process.communicate()

    def finish(self) -> None:
        """Fit, report, print; raises `StorageError` when that process fails.

        The scan is over: a Ctrl-C that comes now has nothing left to stop.
        """
        before = signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            self._process.communicate(GO)
        finally:
            signal.signal(signal.SIGINT, before)
        if self._process.returncode != 0:
            raise StorageError(
                f"{self._folder}: the record is complete, but fit and report have failed; go on "
                f"with: gonio report {self._folder}"
            )
