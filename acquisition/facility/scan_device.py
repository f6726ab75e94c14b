"""Scan of a protocol as one device for bluesky: set to a step, triggered, read, halted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path

from acquisition.facility.devices.actions import ActionStatus, ActionThread
from acquisition.facility.devices.readings import (
    KeyDict,
    ReadingDict,
    Value,
    data_key,
    data_keys,
    readings,
)
from acquisition.facility.scan_session import ScanSession
from acquisition.facility.table_columns import Columns, columns_of
from acquisition.plan.plan import Plan
from instrument.config.load import Loaded
from instrument.errors import DeviceError
from instrument.record.reading import Reading

SOURCE = "gonio:scan"
_TYPES = {"int": int, "float": float}


def reading_keys() -> dict[str, KeyDict]:
    """Return the description of each value of a reading as in the record, with its unit."""
    kinds = {f.name: _TYPES.get(str(f.type), str) for f in fields(Reading)}
    return {name: data_key(name, kind, SOURCE) for name, kind in kinds.items()}


def column_keys(columns: Columns) -> dict[str, KeyDict]:
    """Return the description of each column of a table, with its unit."""
    return {name: data_key(name, type(col[0]), SOURCE) for name, col in columns.items()}


def configuration_of(identities: Mapping[str, str]) -> dict[str, Value]:
    """Return which devices answered, by role, as configuration of a scan."""
    return {f"{role}_identity": text for role, text in identities.items()}


def configuration_keys(identities: Mapping[str, str]) -> dict[str, KeyDict]:
    """Return the description of each value of `configuration_of`."""
    return data_keys(configuration_of(identities), SOURCE)


class ScanDevice:
    """Scan of a protocol: `set(step)` moves, `trigger` measures, `read` returns the reading.

    Staging opens the devices and homes the axes; unstaging makes the rig safe and closes them. All
    that a pause or an abort can interrupt leaves a record with which `gonio resume` goes on.
    """

    parent = None

    def __init__(self, loaded: Loaded, plan: Plan, folder: Path) -> None:
        self.name = "scan"
        self._session, self._thread = ScanSession(loaded, plan, folder), ActionThread()
        self._step = 0

    @property
    def hints(self) -> dict[str, list[str]]:
        """Field to plot."""
        return {"fields": ["signal_dn"]}

    def stage(self) -> ActionStatus:
        """Begin the scan: record, devices, reference of each axis, first darks."""
        return self._thread.begin(self._session.begin)

    def unstage(self) -> ActionStatus:
        """Stop all motion now; then make the rig safe and close its devices and the record."""
        self.stop()
        status = self._thread.begin(self._session.end)
        status.add_callback(lambda _: self._thread.end())
        return status

    def set(self, value: int) -> ActionStatus:
        """Begin to move to the pose of a step of the plan, by its number."""
        halts, self._step = self._session.halts, value
        return self._thread.begin(lambda: self._session.move(value, halts))

    def trigger(self) -> ActionStatus:
        """Begin to take the frames of the step."""
        step = self._step
        return self._thread.begin(lambda: self._session.measure(step))

    def stop(self, success: bool = True) -> None:
        """Stop all axes now, from any thread; `success`: the move that ends is no failure."""
        self._session.halt(expected=success)

    def pause(self) -> None:
        """Stop all axes; the lamp stays as it is."""
        self.stop()
        self._thread.begin(self._session.note_pause)

    def resume(self) -> None:
        """Have the lamp checked for drift before the next step."""
        self._thread.begin(self._session.note_resume)

    def missing(self) -> list[int]:
        """Return the numbers of the steps still to be measured."""
        return self._thread.ask(self._session.missing)

    def read(self) -> dict[str, ReadingDict]:
        """Return the last reading, as in the record: counts with each part of their u."""
        last = self._session.reading
        if last is None:
            raise DeviceError("scan: no step has been measured yet")
        return readings(asdict(last), self._session.now_s())

    def describe(self) -> dict[str, KeyDict]:
        """Return the units of what `read` returns."""
        return reading_keys()

    def read_configuration(self) -> dict[str, ReadingDict]:
        """Return which devices answered."""
        return readings(configuration_of(self._session.identities), self._session.now_s())

    def describe_configuration(self) -> dict[str, KeyDict]:
        """Return the description of what `read_configuration` returns."""
        return configuration_keys(self._session.identities)

    def table(self) -> TableDevice:
        """Return the device of the scan's table, whose staging ends the scan."""
        return TableDevice(self._thread, self._session)


class TableDevice:
    """Table of a scan, row by row: staging ends the scan, fits and reports; `set(row)`, `read`."""

    parent = None

    def __init__(self, thread: ActionThread, session: ScanSession) -> None:
        self.name = "table"
        self._thread, self._session = thread, session
        self._columns: Columns = {}
        self._row = 0

    @property
    def hints(self) -> dict[str, list[str]]:
        """Field to plot."""
        return {"fields": ["brdf" if "brdf" in self._columns else "radiance"]}

    @property
    def rows(self) -> int:
        """Number of rows; 0 before the scan has ended."""
        return len(next(iter(self._columns.values()), []))

    def stage(self) -> ActionStatus:
        """End the scan, and write its results into the run's folder."""
        return self._thread.begin(self._finish)

    def unstage(self) -> list[object]:
        """Do nothing: the table stays."""
        return [self]

    def set(self, value: int) -> ActionStatus:
        """Turn to a row by its number, from 0."""
        self._row = value
        return self._thread.begin(lambda: None)

    def read(self) -> dict[str, ReadingDict]:
        """Return one row of measurements.csv."""
        row = {name: column[self._row] for name, column in self._columns.items()}
        return readings(row, self._session.now_s())

    def describe(self) -> dict[str, KeyDict]:
        """Return the units of the columns."""
        return column_keys(self._columns)

    def _finish(self) -> None:
        self._columns = columns_of(self._session.finish())
