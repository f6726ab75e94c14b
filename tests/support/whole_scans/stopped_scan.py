"""Scans that end after a chosen step, and their resumption."""

from __future__ import annotations

from collections.abc import Callable

from acquisition.engine.engine import Devices, Engine
from acquisition.engine.resume import Progress
from acquisition.plan.plan import Step, make_plan
from acquisition.rig import open_devices
from instrument.config.load import Loaded
from instrument.record.record import Record


class Cut(Exception):
    """The process dies here."""


def scan(
    loaded: Loaded,
    record: Record,
    upto: int | None = None,
    changed_devices: Callable[[Devices], Devices] = lambda devices: devices,
) -> None:
    """Run, or resume what the record holds; end as if killed once step `upto` is on disk."""

    def on_step(step: Step) -> None:
        if step.index == upto:
            raise Cut

    devices = changed_devices(open_devices(loaded))
    before = Progress.of(record) if record.readings() else None
    try:
        Engine(loaded.protocol, loaded.rig, devices, record, on_step).run(make_plan(loaded), before)
    except Cut:
        return
