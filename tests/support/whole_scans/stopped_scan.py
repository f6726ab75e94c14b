"""Scans that end after a chosen step, and their resumption."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

from acquisition.engine.engine import Devices, Engine
from acquisition.engine.resume import Progress
from acquisition.plan.plan import Plan, Step, make_plan
from acquisition.rig import open_devices
from instrument.config.load import Loaded
from instrument.record.reading import Reading
from instrument.record.record import Record


class Cut(Exception):
    """The process dies here."""


def stops(readings: Sequence[Reading], slow: bool) -> list[int]:
    """Steps after which a scan is stopped: all but the last, or one between each two kinds."""
    between = itertools.pairwise(reading.kind for reading in readings)
    first = {pair: step for step, pair in reversed(list(enumerate(between)))}
    return list(range(len(readings) - 1)) if slow else sorted(first.values())


def scan(
    loaded: Loaded,
    record: Record,
    upto: int | None = None,
    changed_devices: Callable[[Devices], Devices] = lambda devices: devices,
    plan: Plan | None = None,
) -> None:
    """Run, or resume what the record holds; end as if killed once step `upto` is on disk.

    plan: in place of that of the protocol.
    """

    def on_step(step: Step) -> None:
        if step.index == upto:
            raise Cut

    devices = changed_devices(open_devices(loaded))
    before = Progress.of(record) if record.readings() else None
    engine = Engine(loaded.protocol, loaded.rig, devices, record, on_step)
    try:
        engine.run(plan or make_plan(loaded), before)
    except Cut:
        return
