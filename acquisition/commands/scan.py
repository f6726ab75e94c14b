"""Commands that scan or use a scan's record: `gonio run`, `plan`, `resume` and `report`."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from acquisition.commands.determinable import Determinable
from acquisition.commands.fit_status import no_fit_reported, print_json, require_result
from acquisition.commands.outcomes.new_folder import require_new_folder, write_files
from acquisition.commands.outcomes.pdf import browser, print_pdf
from acquisition.commands.scan_session import scan
from acquisition.commands.views import print_outcome, print_plan
from acquisition.engine.frame_files import require_disk_space, require_own_folder
from acquisition.engine.resume import Progress
from acquisition.live.page_process import live_page, require_libraries
from acquisition.plan.moves import moves_between
from acquisition.plan.plan import Plan, make_plan
from acquisition.plan.pose import home_pose
from acquisition.results.damage import damage_text
from acquisition.results.model_check import check_model
from acquisition.results.run_folder import (
    default_folder,
    load_run_inputs,
    run_meta,
    write_run_inputs,
)
from acquisition.rig import check_ready, require_dated
from acquisition.terminal.console import console
from acquisition.terminal.operator import require_yes
from acquisition.terminal.orderly_end import orderly_end
from acquisition.terminal.progress import sign_of_life
from instrument.config.load import Loaded, load_protocol
from instrument.errors import OperatorStop
from instrument.record.event_kinds import DAMAGED, FAULT, FINISHED, RESUMED, STOPPED
from instrument.record.record import Record

if TYPE_CHECKING:
    from acquisition.adaptive.chooser import Chooser

_KILLED = (
    "The scan ended without a word: its program was killed, or the computer was switched off. What "
    "moved then went on to the end of its move, or may still be moving\n"
)
_STATES = (FAULT, STOPPED, RESUMED, FINISHED)


def run_protocol(
    protocol_path: Path,
    rig_path: Path | None,
    out: Path | None,
    *,
    as_json: bool,
    live: bool = False,
    until: str | None = None,
    budget_min: float | None = None,
) -> None:
    """Plan, scan, fit and report; `live`: with a page in the browser.

    until: goal of a scan that chooses its geometries, in place of the protocol's; budget_min: its
    bench time in minutes. Raises `InputError` before anything moves; `DeviceError`,
    `StorageError` or `OperatorStop` where the scan ends early.
    """
    loaded = load_protocol(protocol_path, rig_path, check_model=check_model)
    loaded = _with_goal(loaded, until, budget_min)
    scan_into(loaded, out, lambda record, used: _finish(record, used, as_json), live=live)


def _with_goal(loaded: Loaded, until: str | None, budget_min: float | None) -> Loaded:
    """Return the protocol with the goal of the options, if there are any."""
    if until is None and budget_min is None:
        return loaded
    from acquisition.adaptive.candidate_list import with_goal  # heavy: only for such scans

    return with_goal(loaded, until, budget_min)


def _candidates(loaded: Loaded) -> tuple[Loaded, Chooser]:
    """Return the list of candidates of a protocol with a goal, and the choice among them."""
    from acquisition.adaptive.aims import Aims
    from acquisition.adaptive.candidate_list import candidate_list
    from acquisition.adaptive.course import chooser_of

    Aims.of(loaded)  # its mistakes are named with their lines in the file as it is
    listed = candidate_list(loaded)
    return listed, chooser_of(listed, make_plan(listed))


def _growing(chooser: Chooser, record: Record) -> Plan:
    from acquisition.adaptive.course import chosen_while_measured

    def say(text: str) -> None:
        console.print(text, highlight=False, soft_wrap=True)

    return chosen_while_measured(chooser, record, say)


def scan_into(
    loaded: Loaded,
    out: Path | None,
    finish: Callable[[Record, Loaded], object],
    *,
    live: bool = False,
) -> Path:
    """Plan and scan into a new folder; call `finish` with the complete record and its protocol.

    `live`: show it in a browser meanwhile. Returns the folder: `out`, or one named after the
    protocol and the time. Raises as `run_protocol` does, and what `finish` raises.
    """
    chooser = None
    if loaded.protocol.goal is not None:
        loaded, chooser = _candidates(loaded)
    plan = make_plan(loaded)
    if live:
        require_libraries()
    require_dated(loaded)
    check_ready(loaded)
    folder = out if out is not None else default_folder(loaded)
    require_disk_space(plan, loaded, folder)
    with (
        orderly_end(),
        Record.create(folder, run_meta(loaded, plan)) as record,
        record.claimed(),
    ):
        write_run_inputs(record)
        with _shown(record, live):
            scan(loaded, plan if chooser is None else _growing(chooser, record), record)
            finish(record, loaded)
    return folder


@contextmanager
def _shown(record: Record, live: bool) -> Iterator[None]:
    """Show a run in the browser within a `with` block, if that is wanted."""
    if not live:
        yield
        return
    with live_page(record.folder) as address:
        console.print(f"live page: {address}", highlight=False, soft_wrap=True)
        yield


def resume_run(folder: Path, *, yes: bool, as_json: bool, live: bool = False) -> None:
    """Measure what is missing of a stopped run, then fit and report; a complete run is only fitted.

    `yes`: the rig may move, without asking the operator. `live`: with a page in the browser.
    """
    if live:
        require_libraries()
    with orderly_end(), Record.open(folder, claim=True) as record:
        write_run_inputs(record)
        loaded = load_run_inputs(record)
        plan = _plan_of(loaded, record)
        progress = Progress.of(record)
        missing = progress.missing(plan)
        if missing or plan.growing:
            # Raises, before anything moves, where no way leads to the first missing pose.
            for step in missing[:1]:
                moves_between(home_pose(loaded.rig), step.pose, loaded.rig)
            check_ready(loaded)
            require_own_folder(loaded, folder)
            _confirm(yes, len(missing), record, growing=plan.growing)
            _remove_damaged(record)
        elif plan.choosing is not None:
            # It may have been killed before it said so.
            record.set_meta("steps", str(len(plan.known)))
        with _shown(record, live):
            if missing or plan.growing:
                scan(loaded, plan, record, progress)
            _finish(record, loaded, as_json)


def _plan_of(loaded: Loaded, record: Record) -> Plan:
    """Return the plan of a run that was begun; its choices so far are in its record."""
    plan = make_plan(loaded)
    if loaded.protocol.goal is None:
        return plan
    from acquisition.adaptive.course import chooser_of

    return _growing(chooser_of(loaded, plan), record)


def report_run(
    folder: Path, *, pdf: bool = False, figures: Path | None = None, as_json: bool
) -> None:
    """Fit a run again and write its table and report anew; opens no device.

    `pdf`: print the report to a PDF file, too. `figures`: new folder for its figures.
    """
    printer = browser() if pdf else None
    if figures is not None:
        require_new_folder(figures, "--figures")
    with orderly_end(), Record.open(folder) as record:
        _finish(record, load_run_inputs(record), as_json, printer, figures)


def show_plan(protocol_path: Path, rig_path: Path | None, as_json: bool) -> None:
    """Print the plan of a scan; opens no device."""
    loaded = load_protocol(protocol_path, rig_path, check_model=check_model)
    plan, adaptive = make_plan(loaded), None
    if loaded.protocol.goal is not None:
        from acquisition.commands.planning.adaptive import AdaptivePlan

        adaptive = AdaptivePlan.of(loaded)
    if as_json:
        found = _plan_json(loaded, plan)
        found |= {} if adaptive is None else {"adaptive": adaptive.as_json()}
        sys.stdout.write(json.dumps(found, allow_nan=False) + "\n")
        return
    print_plan(loaded, plan)
    if adaptive is not None:
        adaptive.show()


def _plan_json(loaded: Loaded, plan: Plan) -> dict[str, object]:
    determinable = Determinable.of(loaded.protocol, [step.pose for step in plan.points])
    return {
        "points": len(plan.points),
        "hidden": [pose._asdict() for pose in plan.hidden],
        "duration_s": plan.duration_s,
        "surface_changes": plan.swaps,
        "hand_settings": plan.hand_settings,
        "can_determine": determinable.yes,
        "will_not_determine": determinable.no,
        "steps": [asdict(step) | {"pose": step.pose._asdict()} for step in plan.steps],
    }


def _finish(
    record: Record,
    loaded: Loaded,
    as_json: bool,
    printer: str | None = None,
    figures: Path | None = None,
) -> None:
    """Fit, report and print the outcome. The scan is over: a Ctrl-C costs no reading.

    `printer`: browser that prints the report to a PDF file. `figures`: folder for its figures.
    Raises, after all files are written, as `fit_status.require_result` does.
    """
    try:
        with (
            orderly_end(),
            no_fit_reported(record.folder, as_json),
            sign_of_life("fit and report"),
        ):
            from acquisition.results.finish import finish  # heavy: only after a scan

            outcome = finish(record, loaded)
    except KeyboardInterrupt:
        raise OperatorStop(
            f"stopped by the operator before the report was written. Nothing measured is lost: "
            f"{len(record.readings())} readings are safe in {record.folder}. Fit and report them "
            f"with: gonio report {record.folder}"
        ) from None
    if as_json:
        print_json(outcome.fit)
    else:
        print_outcome(outcome)
    if printer is not None:
        printed = print_pdf(outcome.report, printer)
        console.print(f"report as PDF: {printed}", highlight=False, soft_wrap=True)
    if figures is not None:
        from analysis.report.figure_data import figure_files

        files = figure_files(outcome.content)
        write_files(figures, files)
        written = f"{len(files)} files in {figures}" if files else "no value to draw"
        console.print(f"figures: {written}", highlight=False, soft_wrap=True)
    require_result(outcome.fit, f"{record.folder}: {outcome.state}")


def _confirm(yes: bool, steps: int, record: Record, *, growing: bool = False) -> None:
    """Ask whether the rig may move, unless `yes` says so; record who answered.

    growing: more steps may be chosen beside those that are missing.
    """
    ended = _ended_with(record)
    if yes:
        console.print(ended, end="", highlight=False, soft_wrap=True)
    else:
        last = f"{damage_text(record)}\n" if record.damaged() else ""
        more = ", more may be chosen" if growing else ""
        require_yes(
            f"{ended}{last}{steps} readings are missing or doubtful{more}. Is the rig clear, may "
            "the stage move?",
            "gonio resume: nobody to ask whether the rig may move: add --yes",
            "not resumed: nothing has moved",
        )
    how = "--yes" if yes else "yes, asked at the terminal"
    record.add_event(datetime.now(UTC).isoformat(), RESUMED, f"the rig may move: {how}")


def _ended_with(record: Record) -> str:
    """Return a line that says why the scan ended; a program that was killed has left no word."""
    events = [(RESUMED, ""), *((kind, why) for _, kind, why in record.events() if kind in _STATES)]
    kind, why = events[-1]
    if kind == FINISHED:  # readings were damaged since
        return ""
    return _KILLED if kind == RESUMED else f"The scan ended with: {why}\n"


def _remove_damaged(record: Record) -> None:
    """Remove the rows that are measured again; the record and the operator are told which."""
    text = damage_text(record)
    if text:
        record.remove_damaged()
        record.add_event(datetime.now(UTC).isoformat(), DAMAGED, text)
        console.print(f"{text}; readings are measured again", highlight=False, soft_wrap=True)
