"""Plan for bluesky's run engine that measures a protocol: `gonio_scan`."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from pathlib import Path
from typing import Any

from acquisition.facility.devices.rig_devices import require_drivable
from acquisition.facility.metadata import READINGS, TABLE, start_metadata
from acquisition.facility.scan_device import ScanDevice
from acquisition.plan.plan import Plan, make_plan
from acquisition.results.model_check import check_model
from acquisition.results.run_folder import default_folder, run_meta
from instrument.config.load import Loaded, load_protocol
from instrument.errors import InputError

Messages = Generator[Any, Any, Any]


def gonio_scan(
    protocol: Path | str,
    rig: Path | str | None = None,
    out: Path | str | None = None,
    md: Mapping[str, object] | None = None,
) -> Messages:
    """Measure a protocol as `gonio run` does, step by step under bluesky's run engine.

    rig: a rig file in place of the one that the protocol names. out: folder for the run, absent or
    empty; default `runs/NAME-DATE-TIME`. md: further entries of the start document. Each step is an
    event of the stream "readings", with the counts and each part of their u; at the end each row of
    measurements.csv is one of the stream "measurements". The folder holds the record and the
    report; its path is what the plan returns. Raises `InputError` before anything moves; a move or
    an exposure that fails is a failed status whose message names the command that resumes the scan.
    """
    loaded, plan = _planned(protocol, rig)
    folder = default_folder(loaded) if out is None else Path(out)
    scan = ScanDevice(loaded, plan, folder)
    about = start_metadata(run_meta(loaded, plan), loaded) | dict(md or {})
    return (yield from _measured(scan, about, str(folder)))


def _planned(protocol: Path | str, rig: Path | str | None) -> tuple[Loaded, Plan]:
    rig_path = None if rig is None else Path(rig)
    loaded = load_protocol(Path(protocol), rig_path, check_model=check_model)
    require_drivable(loaded.rig, loaded.rig_path)
    wanted = {"goal": loaded.protocol.goal is not None, "motion": loaded.protocol.motion == "fly"}
    for key, asked in wanted.items():
        if asked:
            raise InputError(
                f"{loaded.protocol_path}: {key}: a run engine visits planned geometries, one at a "
                "time; leave it out, or use the command gonio run"
            )
    return loaded, make_plan(loaded)


def _measured(scan: ScanDevice, about: dict[str, object], folder: str) -> Messages:
    stubs, preprocessors = _bluesky()
    table = scan.table()

    def steps_then_table() -> Messages:
        while missing := scan.missing():  # a lamp that has jumped casts doubt on some once more
            for step in missing:
                yield from stubs.checkpoint()
                yield from stubs.mv(scan, step)
                yield from stubs.trigger_and_read([scan], name=READINGS)
        yield from stubs.stage(table, wait=True, group="table")
        for row in range(table.rows):
            yield from stubs.checkpoint()
            yield from stubs.mv(table, row)
            yield from stubs.trigger_and_read([table], name=TABLE)
        yield from stubs.unstage(table)

    run = preprocessors.run_wrapper(steps_then_table(), md=about)
    yield from preprocessors.stage_wrapper(run, [scan])
    return folder


def _bluesky() -> tuple[Any, Any]:
    try:
        from bluesky import plan_stubs, preprocessors
    except ImportError:
        raise InputError(
            "gonio_scan: bluesky is not installed: pip install 'gonio[bluesky]'"
        ) from None
    return plan_stubs, preprocessors
