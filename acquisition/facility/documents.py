"""Event documents of a run that was measured, from its record: as if a run engine had led it.

The same run gives the same documents, with the same identifiers. They hold what `gonio_scan` emits
while it measures: a stream of readings, and one of the rows of measurements.csv.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any
from uuid import NAMESPACE_URL, UUID, uuid5

from acquisition.facility.devices.readings import KeyDict, Value
from acquisition.facility.metadata import KEYS, READINGS, TABLE, start_metadata
from acquisition.facility.scan_device import (
    column_keys,
    configuration_keys,
    configuration_of,
    reading_keys,
)
from acquisition.facility.table_columns import columns_of
from acquisition.results.facts.chosen_geometries import reasons
from acquisition.results.fitting import fit_run
from acquisition.results.measurements_csv import measurements_csv
from acquisition.results.reduction import reduced_run, require_usable
from acquisition.results.run_folder import load_run_inputs
from acquisition.results.summary import scan_state
from instrument.config.load import Loaded
from instrument.errors import InputError
from instrument.record.record import Record

Document = tuple[str, dict[str, Any]]
Row = Mapping[str, Value]


@dataclass(frozen=True, slots=True)
class _Stream:
    """Rows of one stream of events, each with its time in UTC as text."""

    name: str
    keys: dict[str, KeyDict]
    rows: Sequence[Row]
    identities: Mapping[str, str]


def run_documents(folder: Path) -> Iterator[Document]:
    """Yield the documents of a run by name: start, and descriptor and events of each stream, stop.

    A run that is not complete ends with the status "abort" and what is missing. Raises `InputError`
    without bluesky or for a folder that is no run, `NoMeasurement` where nothing was measured.
    """
    compose_run = _compose_run()
    with Record.open(folder) as record:
        loaded = load_run_inputs(record)
        table = _table(record, loaded)
        readings = [asdict(reading) for reading in record.readings()]
        meta = {key: text for key in KEYS if (text := record.meta(key)) is not None}
        identities, state = record.devices(), scan_state(record)
        complete = len(readings) >= int(record.meta("steps") or 0)
    columns = columns_of(table)
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    streams = (
        _Stream(READINGS, reading_keys(), readings, identities),
        _Stream(TABLE, column_keys(columns), rows, {}),
    )
    times = [_seconds(row) for row in readings]
    uid = uuid5(NAMESPACE_URL, f"gonio:{json.dumps(meta, sort_keys=True)} {min(times)}")
    about = start_metadata(meta, loaded) | {"hints": {}}
    bundle = compose_run(uid=str(uid), time=min(times), metadata=about)
    yield "start", dict(bundle.start_doc)
    for stream in streams:
        yield from _stream_documents(stream, bundle, uid)
    status, reason = ("success", "") if complete else ("abort", state)
    stop = bundle.compose_stop(
        exit_status=status, reason=reason, uid=str(uuid5(uid, "stop")), time=max(times)
    )
    yield "stop", dict(stop)


def _table(record: Record, loaded: Loaded) -> str:
    reduced = reduced_run(record, loaded)
    require_usable(reduced)
    fitted = fit_run(reduced, loaded)
    u_brdf, parts = fitted.u_brdf(reduced), fitted.parts(reduced)
    return measurements_csv(reduced, u_brdf, parts, loaded, reasons(record))


def _stream_documents(stream: _Stream, bundle: Any, run: UUID) -> Iterator[Document]:
    own = partial(_uid, run, stream.name)
    begun_s = min(_seconds(row) for row in stream.rows)
    composed = bundle.compose_descriptor(
        name=stream.name,
        data_keys=stream.keys,
        object_keys={"scan": list(stream.keys)},
        configuration={"scan": _configuration(stream.identities, begun_s)},
        time=begun_s,
        uid=own("descriptor"),
    )
    yield "descriptor", dict(composed.descriptor_doc)
    for number, row in enumerate(stream.rows, 1):
        time_s = _seconds(row)
        event = composed.compose_event(
            data=dict(row),
            timestamps=dict.fromkeys(row, time_s),
            seq_num=number,
            time=time_s,
            uid=own(str(number)),
        )
        yield "event", dict(event)


def _configuration(identities: Mapping[str, str], time_s: float) -> dict[str, Any]:
    data, keys = configuration_of(identities), configuration_keys(identities)
    return {"data": data, "timestamps": dict.fromkeys(data, time_s), "data_keys": keys}


def _uid(run: UUID, stream: str, name: str) -> str:
    return str(uuid5(run, f"{stream} {name}"))


def _seconds(row: Row) -> float:
    """Return the time of a row in seconds of the Unix epoch."""
    read = datetime.fromisoformat(str(row["time_utc"]))
    return (read if read.tzinfo else read.replace(tzinfo=UTC)).timestamp()


def _compose_run() -> Callable[..., Any]:
    try:
        from event_model import compose_run
    except ImportError:
        raise InputError(
            "documents of a run: bluesky is not installed: pip install 'gonio[bluesky]'"
        ) from None
    return compose_run
