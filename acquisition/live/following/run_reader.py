"""Reader of a run's record for its page, while a scan may be writing to it.

It is the only one of its process: the end of a second one would release SQLite's locks of the
first (POSIX, fcntl). Each reading is one short transaction, and the work follows after it: in a
write-ahead log a reader holds up no writer.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Iterable
from pathlib import Path

from acquisition.measure.rectify.kept_files import FOLDER
from acquisition.results.run_folder import load_run_inputs
from instrument.closeable import Closeable
from instrument.record.event_kinds import DAMAGED, RESUMED
from instrument.record.reading import Preview, Rows
from instrument.record.record import FILE_NAME, Record


class RunReader(Closeable):
    """Open run. Any thread may use it.

    Raises `InputError` or `StorageError` where the folder is no run, or one that cannot be read.
    """

    def __init__(self, folder: Path) -> None:
        self._lock = threading.Lock()
        self._record = Record.open(folder)
        self.record_file = self._record.folder / FILE_NAME
        try:
            self.loaded = load_run_inputs(self._record)
            self.started_utc = self._record.meta("started_utc") or ""
            self._replacements = _replacements(self._record.events())
        except BaseException:
            self._record.close()
            raise
        self._version: int | None = None
        self._stale, self._last_folder = False, folder.absolute()

    @property
    def folder(self) -> Path | None:
        """The run's folder, wherever it was moved to; None if it was removed."""
        return self._record.current_folder()

    def changed_rows(self) -> Rows | None:
        """Return the rows if they have changed since the last time, else None.

        Raises `sqlite3.Error` where the record cannot be read any more, `GonioError` where it is
        none any more.
        """
        with self._lock:
            if self._stale:
                self._reopen()
            version = self._record.version()
            if version == self._version:
                return None
            rows = self._record.rows()
            if _replacements(rows.events) != self._replacements:
                self._stale = True
                self._reopen()
                version, rows = self._record.version(), self._record.rows()
            self._version = version
            return rows

    def frame_file(self, step: int) -> str | None:
        """Return the first kept frame of a step, relative to the run's folder, None without one.

        It is a name that a scan gives; a record from elsewhere may hold any.
        """
        own = re.compile(rf"{FOLDER}/{step:06d}-\d+\.tiff", re.ASCII)
        with self._lock:
            return next(filter(own.fullmatch, self._record.frame_files()), None)

    def preview(self, step: int) -> Preview | None:
        """Return the picture of a step that the record itself holds, None without one."""
        with self._lock:
            return next((p for p in self._record.previews() if p.step == step), None)

    def close(self) -> None:
        """Close the record; may be called twice."""
        with self._lock:
            self._record.close()

    def _reopen(self) -> None:
        """Open the record anew: a resume has removed rows that were damaged, and measured again.

        A record names the damaged rows that it found when it was opened, and leaves them out.
        """
        self._last_folder = self._record.current_folder() or self._last_folder
        self._record.close()
        self._record = Record.open(self._last_folder)
        self._replacements = _replacements(self._record.events())
        self._stale = False


def _replacements(events: Iterable[tuple[str, str, str]]) -> int:
    """Return how often rows may have been replaced."""
    return sum(kind in (RESUMED, DAMAGED) for _, kind, _ in events)
