"""What drivers say while they work (a question asked again, a frame refused) goes into the record.

Drivers only log. They do so from several threads, the record belongs to one: messages wait in a
queue until that one writes them down.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from queue import Empty, SimpleQueue

from instrument.record.event_kinds import RETRY, TROUBLE
from instrument.record.record import Record

SPEAKERS = ("drivers", "acquisition", "sim")


class EventLogHandler(logging.Handler):
    """Keeps what is logged until `write` puts it into the record: its level says what it is.

    `troubles`: what a person has to be told as well.
    """

    def __init__(self, record: Record) -> None:
        super().__init__(logging.WARNING)
        self._record = record
        self.troubles: list[str] = []
        self._waiting: SimpleQueue[logging.LogRecord] = SimpleQueue()

    def emit(self, record: logging.LogRecord) -> None:
        """Take a message from any thread."""
        if record.levelno >= logging.ERROR:
            self.troubles.append(record.getMessage())
        self._waiting.put(record)

    def write(self) -> None:
        """Write down what has come, in order; raises `StorageError`."""
        while True:
            try:
                said = self._waiting.get_nowait()
            except Empty:
                return
            time_utc = datetime.fromtimestamp(said.created, UTC).isoformat()
            kind = RETRY if said.levelno < logging.ERROR else TROUBLE
            self._record.add_event(time_utc, kind, said.getMessage())


@contextmanager
def noted(record: Record) -> Iterator[EventLogHandler]:
    """Listen to all drivers for a while."""
    handler = EventLogHandler(record)
    speakers = [logging.getLogger(name) for name in SPEAKERS]
    for speaker in speakers:
        speaker.addHandler(handler)
    try:
        yield handler
    finally:
        for speaker in speakers:
            speaker.removeHandler(handler)
