"""The commands that scan: what `gonio run`, `plan`, `resume` and `report` do."""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from acquisition.afterwards import Afterwards
from acquisition.console import (
    console,
    duration_text,
    print_outcome,
    print_plan,
    progress,
)
from acquisition.engine import Devices, Engine
from acquisition.models import check_model
from acquisition.motion import home_pose, moves_between
from acquisition.plan import Plan, make_plan
from acquisition.rig import open_devices, prepare
from acquisition.terminal import require_yes
from instrument.config import Loaded, load_protocol
from instrument.errors import DeviceError, InputError, OperatorStop
from instrument.files import write_whole
from instrument.record import Record

PROTOCOL_FILE, RIG_FILE = "protocol.yaml", "rig.yaml"


def run_protocol(
    protocol_path: Path, rig_path: Path | None, out: Path | None, as_json: bool
) -> None:
    """Plan, scan, fit, report. Raises `InputError` before anything moves, or what the scan met."""
    loaded = load_protocol(protocol_path, rig_path, check_model=check_model)
    plan = make_plan(loaded)
    prepare(loaded)
    folder = out if out is not None else _default_folder(loaded)
    with Record.create(folder, _meta(loaded, plan)) as record:
        write_whole(folder / PROTOCOL_FILE, loaded.protocol_text)
        write_whole(folder / RIG_FILE, loaded.rig_text)
        with Afterwards(folder, as_json) as afterwards:
            _scan(loaded, plan, record)
            afterwards.finish()


def resume_run(folder: Path, yes: bool, as_json: bool) -> None:
    """Go on with a stopped run; a finished one is fitted and reported again."""
    with Record.open(folder) as record:
        loaded = as_used(record)
        plan = make_plan(loaded)
        done = frozenset(reading.step for reading in record.readings())
        missing = [step for step in plan.steps if step.index not in done]
        if missing:
            moves_between(home_pose(loaded.rig), missing[0].pose, loaded.rig)  # or nothing moves
            prepare(loaded)
            _confirm(yes, len(missing))
            _scan(loaded, plan, record, done)
        _finish(record, loaded, as_json)


def report_run(folder: Path, as_json: bool) -> None:
    """Fit a run again and write its tables and report anew; touches no device."""
    with Record.open(folder) as record:
        _finish(record, as_used(record), as_json)


def show_plan(protocol_path: Path, rig_path: Path | None, as_json: bool) -> None:
    """Print what a scan would do; touches no device."""
    loaded = load_protocol(protocol_path, rig_path, check_model=check_model)
    plan = make_plan(loaded)
    if as_json:
        sys.stdout.write(json.dumps(_plan_json(plan), allow_nan=False) + "\n")
    else:
        print_plan(loaded, plan)


def _plan_json(plan: Plan) -> dict[str, object]:
    return {
        "points": len(plan.points),
        "hidden": [pose._asdict() for pose in plan.hidden],
        "duration_s": plan.duration_s,
        "surface_changes": plan.swaps,
        "hand_settings": plan.hand_settings,
        "steps": [asdict(step) | {"pose": step.pose._asdict()} for step in plan.steps],
    }


def _scan(loaded: Loaded, plan: Plan, record: Record, done: frozenset[int] = frozenset()) -> None:
    """Run the plan; whatever ends it early is in the record and in the message."""
    elapsed_s = max((reading.time_s for reading in record.readings()), default=0.0)
    devices = open_devices(loaded, elapsed_s)
    try:
        _drive(loaded, plan, record, done, elapsed_s, devices)
    finally:
        devices.close()


def _drive(
    loaded: Loaded,
    plan: Plan,
    record: Record,
    done: frozenset[int],
    elapsed_s: float,
    devices: Devices,
) -> None:
    begun_s = devices.clock.now_s() - elapsed_s
    console.print(
        f"{loaded.protocol.name}: {len(plan.points)} geometries, about "
        f"{duration_text(plan.duration_s)} on the rig ({loaded.rig.name}), into {record.folder}",
        highlight=False,
        soft_wrap=True,
    )
    clock = devices.clock
    try:
        with record.claimed(), progress(plan, done) as on_step:
            engine = Engine(loaded.protocol, loaded.rig, devices, record, on_step)
            engine.run(plan, done, elapsed_s)
    except (KeyboardInterrupt, OperatorStop) as stop:
        why = str(stop) or "stopped by the operator"
        record.add_event(clock.utc().isoformat(), "stopped", why)
        raise OperatorStop(f"{why}: all motion has ended. {_go_on(record)}") from None
    except DeviceError as error:
        record.add_event(clock.utc().isoformat(), "fault", str(error))
        raise DeviceError(f"{error}\n{_go_on(record)}") from error
    record.add_event(clock.utc().isoformat(), "finished", f"{len(plan.steps)} steps")
    record.set_meta("scan_s", f"{clock.now_s() - begun_s:.1f}")
    record.set_meta("finished_utc", clock.utc().isoformat(timespec="seconds"))


def _go_on(record: Record) -> str:
    return (
        f"{len(record.readings())} readings are safe in {record.folder}. Go on with: "
        f"gonio resume {record.folder}"
    )


def _finish(record: Record, loaded: Loaded, as_json: bool) -> None:
    """Reduce, fit, report and say what came out."""
    from acquisition.results import finish

    outcome = finish(record, loaded)
    if as_json:
        sys.stdout.write(json.dumps(outcome.fit, allow_nan=False) + "\n")
    else:
        print_outcome(outcome)


def _default_folder(loaded: Loaded) -> Path:
    now = datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
    return Path("runs") / f"{loaded.protocol_path.stem}-{now}"


def _meta(loaded: Loaded, plan: Plan) -> Mapping[str, str]:
    return {
        "protocol_file": str(loaded.protocol_path),
        "rig_file": str(loaded.rig_path),
        "protocol": loaded.protocol_text,
        "rig": loaded.rig_text,
        "protocol_sha256": _digest(loaded.protocol_text),
        "rig_sha256": _digest(loaded.rig_text),
        "program_version": version("gonio"),
        "started_utc": datetime.now(UTC).isoformat(timespec="seconds"),
        "planned_s": f"{plan.duration_s:.1f}",
        "hidden": str(len(plan.hidden)),
        "steps": str(len(plan.steps)),
    }


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def as_used(record: Record) -> Loaded:
    """The run's own copies of protocol and rig; `InputError` when they are not as they were."""
    folder = record.folder
    loaded = load_protocol(folder / PROTOCOL_FILE, folder / RIG_FILE, check_model=check_model)
    for key, text in (("protocol", loaded.protocol_text), ("rig", loaded.rig_text)):
        if record.meta(f"{key}_sha256") != _digest(text):
            raise InputError(
                f"{folder / (key + '.yaml')}: changed since the run began, so its readings "
                "would not belong together: restore it, or start a new run"
            )
    return loaded


def _confirm(yes: bool, steps: int) -> None:
    """Nothing moves again until the operator has said so."""
    if not yes:
        require_yes(
            f"{steps} readings are missing. Is the rig clear, may the stage move?",
            "gonio resume: nobody to ask whether the rig may move: add --yes",
            "not resumed: nothing has moved",
        )
