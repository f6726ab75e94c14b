"""The commands that scan: what `gonio run`, `plan`, `resume` and `report` do."""

from __future__ import annotations

import hashlib
import json
import platform
import sys
from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from acquisition.afterwards import Afterwards
from acquisition.commands.scan_session import scan
from acquisition.commands.views import print_outcome, print_plan
from acquisition.engine.frame_files import require_room
from acquisition.engine.resume import Progress
from acquisition.plan.moves import home_pose, moves_between
from acquisition.plan.plan import Plan, make_plan
from acquisition.results.model_check import check_model
from acquisition.rig import prepare
from acquisition.terminal.operator import require_yes
from instrument.config.load import Loaded, load_protocol
from instrument.errors import InputError, StorageError
from instrument.record.record import Record
from instrument.text.atomic_file import write_whole

PROTOCOL_FILE, RIG_FILE = "protocol.yaml", "rig.yaml"


def run_protocol(
    protocol_path: Path, rig_path: Path | None, out: Path | None, as_json: bool
) -> None:
    """Plan, scan, fit, report. Raises `InputError` before anything moves, or what the scan met."""
    loaded = load_protocol(protocol_path, rig_path, check_model=check_model)
    plan = make_plan(loaded)
    prepare(loaded)
    folder = out if out is not None else _default_folder(loaded)
    require_room(plan, loaded, folder)
    with Record.create(folder, _meta(loaded, plan)) as record, record.claimed():
        _write_inputs(record)
        with Afterwards(folder, as_json) as afterwards:
            scan(loaded, plan, record)
            afterwards.finish()


def resume_run(folder: Path, yes: bool, as_json: bool) -> None:
    """Go on with a stopped run; a finished one is fitted and reported again."""
    with Record.open(folder) as record:
        _write_inputs(record)
        loaded = load_run_inputs(record)
        plan = make_plan(loaded)
        so_far = Progress(tuple(record.readings()), tuple(record.checks()))
        missing = so_far.missing(plan)
        if missing:
            moves_between(home_pose(loaded.rig), missing[0].pose, loaded.rig)  # or nothing moves
            prepare(loaded)
            with record.claimed():
                _confirm(yes, len(missing), record)
                scan(loaded, plan, record, so_far)
        _finish(record, loaded, as_json)


def report_run(folder: Path, as_json: bool) -> None:
    """Fit a run again and write its tables and report anew; touches no device."""
    with Record.open(folder) as record:
        _finish(record, load_run_inputs(record), as_json)


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


def _finish(record: Record, loaded: Loaded, as_json: bool) -> None:
    """Reduce, fit, report and say what came out."""
    from acquisition.results.finish import finish

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
        "versions": json.dumps(_versions()),
        "started_utc": datetime.now(UTC).isoformat(timespec="seconds"),
        "planned_s": f"{plan.duration_s:.1f}",
        "hidden": str(len(plan.hidden)),
        "steps": str(len(plan.steps)),
    }


def _versions() -> dict[str, str]:
    """What the program ran on; older and newer libraries may round otherwise."""
    libraries = ("numpy", "scipy", "opencv-contrib-python-headless")
    found = {name: version(name) for name in libraries}
    return {"python": platform.python_version(), "system": platform.platform(), **found}


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def load_run_inputs(record: Record) -> Loaded:
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


def _write_inputs(record: Record) -> None:
    """The run's own copies of protocol and rig; a process may have died before it wrote them."""
    for key, name in (("protocol", PROTOCOL_FILE), ("rig", RIG_FILE)):
        text, path = record.meta(key), record.folder / name
        if text is None or path.exists():
            continue
        try:
            write_whole(path, text)
        except StorageError as error:
            raise StorageError(f"{error}, then: gonio resume {record.folder}") from error


def _confirm(yes: bool, steps: int, record: Record) -> None:
    """Nothing moves again until the operator has said so; who said it is in the record."""
    ends = [(kind, why) for _, kind, why in record.events() if kind in ("fault", "stopped")]
    if not yes:
        last = f"The scan ended with: {ends[-1][1]}\n" if ends else ""
        require_yes(
            f"{last}{steps} readings are missing. Is the rig clear, may the stage move?",
            "gonio resume: nobody to ask whether the rig may move: add --yes",
            "not resumed: nothing has moved",
        )
    how = "--yes" if yes else "yes, asked at the terminal"
    record.add_event(datetime.now(UTC).isoformat(), "resumed", f"the rig may move: {how}")
