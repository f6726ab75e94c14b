"""Scans in which a device or the disk fails at a chosen call, for the tests of faults."""

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


class WatchedRecord(Record):
    """Record whose `add_reading` counts as a device call, and whose disk can fail."""

    triggers = Triggers()
    _is_full = False

    def add_reading(
        self,
        reading: Reading,
        preview: Preview | None = None,
        frames: Sequence[Frame] = (),
        files: Sequence[str] = (),
    ) -> None:
        with self.triggers.call("record.add_reading"):
            if self._is_full:  # a small row may find room in a page that is there already
                preview = Preview(reading.step, "larger than a page", bytes(2**16), [])
            super().add_reading(reading, preview, frames, files)

    def refuse_writes(self) -> None:
        """Refuse writes, like a disk remounted read-only."""
        self._db.execute("PRAGMA query_only = ON")

    def fill_disk(self) -> None:
        """Leave no room for the next reading."""
        self._is_full = True
        (pages,) = self._db.execute("PRAGMA page_count").fetchone()
        self._db.execute(f"PRAGMA max_page_count = {pages}")


class WatchedDevice:
    """Forwards all calls to a device and counts them."""

    def __init__(self, name: str, device: object, triggers: Triggers) -> None:
        self._name, self._device, self._triggers = name, device, triggers

    def __getattr__(self, name: str) -> object:
        method = getattr(self._device, name)

        def call(*arguments: object) -> object:
            with self._triggers.call(f"{self._name}.{name}"):
                return method(*arguments)

        return call


@dataclass(frozen=True)
class ScanResult:
    """Outcome of a scan: all readings so far, the error raised, and the events by kind.

    `before`: number of readings that earlier scans had left.
    """

    readings: list[Reading]
    before: int
    error: GonioError | None
    events: dict[str, list[str]]


def scan(
    loaded: Loaded,
    folder: Path,
    open_rig: Callable[[], Devices],
    triggers: Triggers,
    disk: tuple[str, Trigger] | None = None,
) -> ScanResult:
    """Run a scan, or resume the one in the folder. `disk`: a fault of `WatchedRecord`, and when."""
    exists, error = (folder / "record.sqlite").exists(), None
    with (
        patch.object(scan_session, "open_devices", lambda _: open_rig()),
        WatchedRecord.open(folder) if exists else WatchedRecord.create(folder, {}) as record,
    ):
        assert isinstance(record, WatchedRecord)
        record.triggers = triggers
        if disk is not None:
            strike: Action = getattr(record, disk[0])
            triggers.plan(*disk[1], strike)
        before = Progress.of(record) if exists else None
        try:
            scan_session.scan(loaded, make_plan(loaded), record, before)
        except GonioError as raised:
            error = raised
        events: dict[str, list[str]] = {}
        for _, kind, text in record.events():
            events.setdefault(kind, []).append(text)
        count = len(before.readings) if before else 0
        return ScanResult(undated(record.readings()), count, error, events)


def require_reported(
    result: ScanResult, error: type[GonioError], pattern: str, folder: Path
) -> None:
    """The error message states the cause and how to resume; so does the record."""
    text = str(result.error)
    assert isinstance(result.error, error), text
    assert re.search(pattern, text), text
    assert f"gonio resume {folder}" in text
    assert result.error.exit_code == (4 if error is OperatorStop else 3)
    if error is not StorageError:  # which cannot be recorded
        (cause,) = result.events["stopped" if error is OperatorStop else "fault"]
        assert text.startswith(cause)
