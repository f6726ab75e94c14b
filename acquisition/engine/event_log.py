"""Log messages of drivers and engine (retries, refused frames) as events of the record.

Drivers log from several threads, the record belongs to one: messages wait in a queue until that
thread writes them.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime

from instrument.record.event_kinds import INTERLOCK, RETRY, TROUBLE
from instrument.record.record import Record

LOGGERS = ("drivers", "acquisition", "sim", "instrument.record")
INTERLOCKS = "acquisition.interlocks"  # its warnings are what the interlocks did


class EventLogHandler(logging.Handler):
    """Queues messages until `write` records them: warnings as retries, errors as troubles.

    Warnings of the interlocks have a kind of their own. `troubles`: the messages that have to be
    shown to a person as well.
    """

    def __init__(self, record: Record) -> None:
        super().__init__(logging.WARNING)
        self._record = record
        self.troubles: list[str] = []
        self._queue: deque[logging.LogRecord] = deque()

    def emit(self, record: logging.LogRecord) -> None:
        """Queue a message, from any thread."""
        if record.levelno >= logging.ERROR:
            self.troubles.append(record.getMessage())
        self._queue.append(record)

    def write(self) -> None:
        """Write the queued messages to the record, in order; raise `StorageError`."""
        while self._queue:
            message = self._queue.popleft()
            time_utc = datetime.fromtimestamp(message.created, UTC).isoformat()
            self._record.add_event(time_utc, _kind(message), message.getMessage())


def _kind(message: logging.LogRecord) -> str:
    if message.levelno >= logging.ERROR:
        return TROUBLE
    return INTERLOCK if message.name.startswith(INTERLOCKS) else RETRY


@contextmanager
def log_to_record(record: Record) -> Iterator[EventLogHandler]:
    """Collect log messages for the record within a `with` block; yield the handler."""
    handler = EventLogHandler(record)
    loggers = [logging.getLogger(name) for name in LOGGERS]
    for logger in loggers:
        logger.addHandler(handler)
    try:
        yield handler
    finally:
        for logger in loggers:
            logger.removeHandler(handler)
