"""A scan in which something fails at a chosen call: what the tests of faults share."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

from acquisition.commands import scan_session
from acquisition.engine.engine import Devices
from acquisition.engine.resume import Progress
from acquisition.plan.plan import make_plan
from instrument.config.load import Loaded
from instrument.devices import Frame
from instrument.errors import GonioError, OperatorStop, StorageError
from instrument.record.reading import Preview, Reading
from instrument.record.record import Record
from sim.faults.triggers import Action, Triggers, When
from tests.support.scans import undated

Trigger = tuple[When, str, int]


class Watched(Record):
    """A record whose acceptance of a reading is a moment as well, and whose disk can fail."""

    triggers = Triggers()

    def add_reading(
        self,
        reading: Reading,
        preview: Preview | None = None,
        frames: Sequence[Frame] = (),
        files: Sequence[str] = (),
    ) -> None:
        with self.triggers.call("record.add_reading"):
            super().add_reading(reading, preview, frames, files)

    def refuse_writes(self) -> None:
        """As a disk does that the system has made read-only."""
        self._db.execute("PRAGMA query_only = ON")

    def fill_disk(self) -> None:
        """There is room for nothing more."""
        (pages,) = self._db.execute("PRAGMA page_count").fetchone()
        self._db.execute(f"PRAGMA max_page_count = {pages}")


class Watching:
    """Passes all calls on to a device, each of them a moment."""

    def __init__(self, name: str, device: object, triggers: Triggers) -> None:
        self._name, self._device, self._triggers = name, device, triggers

    def __getattr__(self, name: str) -> object:
        found = getattr(self._device, name)

        def called(*arguments: object) -> object:
            with self._triggers.call(f"{self._name}.{name}"):
                return found(*arguments)

        return called


@dataclass(frozen=True)
class Ended:
    """How a scan ended: all readings so far, what it raised, its events by kind."""

    readings: list[Reading]
    before: int
    error: GonioError | None
    events: dict[str, list[str]]


def scan(
    loaded: Loaded,
    folder: Path,
    opened: Callable[[], Devices],
    triggers: Triggers,
    disk: tuple[str, Trigger] | None = None,
) -> Ended:
    """Run, or go on with what is in the folder; `disk`: what happens to it, and when."""
    known, error = (folder / "record.sqlite").exists(), None
    with (
        patch.object(scan_session, "open_devices", lambda _: opened()),
        Watched.open(folder) if known else Watched.create(folder, {}) as record,
    ):
        assert isinstance(record, Watched)
        record.triggers = triggers
        if disk is not None:
            strike: Action = getattr(record, disk[0])
            triggers.plan(*disk[1], strike)
        before = Progress.of(record) if known else None
        try:
            scan_session.scan(loaded, make_plan(loaded), record, before)
        except GonioError as raised:
            error = raised
        events: dict[str, list[str]] = {}
        for _, kind, text in record.events():
            events.setdefault(kind, []).append(text)
        count = len(before.readings) if before else 0
        return Ended(undated(record.readings()), count, error, events)


def require_named(ended: Ended, error: type[GonioError], says: str, folder: Path) -> None:
    """The message says what happened and how to go on, the record the same."""
    text = str(ended.error)
    assert isinstance(ended.error, error), text
    assert re.search(says, text), text
    assert f"gonio resume {folder}" in text
    assert ended.error.exit_code == (4 if error is OperatorStop else 3)
    if error is not StorageError:  # that one cannot be written down
        (why,) = ended.events["stopped" if error is OperatorStop else "fault"]
        assert text.startswith(why)
