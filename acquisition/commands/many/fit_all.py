"""Command `gonio fit --all`: fits of all sources in a folder, by processes or a Dask cluster."""

from __future__ import annotations

import shutil
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from acquisition.batch.cluster import connected, on_cluster, worker_count
from acquisition.batch.found import Found, sources_in
from acquisition.batch.lost import Lost
from acquisition.batch.processes import cores, on_processes
from acquisition.batch.summary import Outcome, SomeFailed, as_csv, as_json
from acquisition.commands.fit import Asked, require_options
from acquisition.commands.fit_status import print_json
from acquisition.commands.many.one_fit import fit_one
from acquisition.commands.outcomes.new_folder import require_new_folder, write_files
from acquisition.terminal.console import console, out, print_lines, print_notes
from acquisition.terminal.layout import table_lines
from acquisition.terminal.orderly_end import orderly_end
from acquisition.terminal.progress import counted_progress
from acquisition.terminal.stop_signals import reason
from instrument.errors import DeviceError, InputError, OperatorStop, StorageError
from instrument.text.atomic_file import explain_os_error, make_folder, write_whole

_SUMMARY = "summary.csv"
_FITS = "fits"  # folder of the fits' own folders
_MOST_NAMED = 3  # files that are no source

Named = tuple[str, Path]
Results = Generator[tuple[Named, Outcome | Lost], None, None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Many:
    """Request for many fits.

    workers: processes at a time, None for the cores that are there. scheduler: address of a Dask
    scheduler in place of processes. out: a new folder, for the files of each fit and a table.
    """

    workers: int | None = None
    scheduler: str | None = None
    out: Path | None = None
    as_json: bool = False


def fit_all(folder: Path, asked: Asked, many: Many) -> None:
    """Fit every run and table in the folder and print a table of the outcomes.

    Raises `InputError` for a wrong option or a folder without sources; after printing what is done,
    `SomeFailed` where some have no result, `OperatorStop` after a signal, `DeviceError` where the
    scheduler is lost.
    """
    require_options(asked)
    found = _found(folder, many)
    outcomes: list[Outcome] = []
    try:
        with orderly_end():
            _fit_each(found, asked, many, outcomes)
    except DeviceError:
        _end(found, outcomes, many)
        raise
    except KeyboardInterrupt:
        _end(found, outcomes, many)
        done = f"{len(outcomes)} of {len(found.sources)} done"
        raise OperatorStop(f"{reason() or 'stopped by the operator'}: {done}") from None
    _end(found, outcomes, many)
    if any(outcome.exit_code for outcome in outcomes):
        raise SomeFailed(sorted(outcomes, key=_order))


def _found(folder: Path, many: Many) -> Found:
    """Find the sources, and refuse options that contradict one another or the folder."""
    if many.workers is not None and many.scheduler is not None:
        raise InputError("--workers: for processes of this computer; a cluster has its own workers")
    found = sources_in(folder)
    if many.out is not None:
        require_new_folder(many.out, "--out")
        if many.out.resolve().is_relative_to(folder.resolve()):
            raise InputError(
                f"--out {many.out}: is inside {folder}, where the next --all would take its tables "
                "for sources: name a folder elsewhere"
            )
    return found


def _fit_each(found: Found, asked: Asked, many: Many, outcomes: list[Outcome]) -> None:
    """Append the outcomes as they are done; write the files of each at once."""
    with (
        _results(found, asked, many) as results,
        counted_progress(len(found.sources), "fitted") as shown,
    ):
        for (name, _), result in results:
            outcome = _outcome(name, result)
            if many.out is not None and outcome.files:
                keep_files(many.out, outcome)
            outcomes.append(outcome)
            shown(_line(outcome), bool(outcome.exit_code))


@contextmanager
def _results(found: Found, asked: Asked, many: Many) -> Iterator[Results]:
    """Outcomes as they are done; leaving the block ends the work on those that are not."""
    work = partial(fit_one, asked=asked, report=many.out is not None)
    items = list(found.sources.items())
    if many.scheduler is None:
        with closing(on_processes(work, items, many.workers or cores())) as results:
            yield results
        return
    items = [(name, path.absolute()) for name, path in items]  # for workers in other folders
    with connected(many.scheduler) as client:
        if not worker_count(client):
            text = f"{many.scheduler} has no worker yet: dask worker {many.scheduler} --nthreads 1"
            console.print(text, highlight=False, soft_wrap=True)
        with closing(on_cluster(work, items, client)) as results:
            yield results


def _outcome(name: str, result: Outcome | Lost) -> Outcome:
    if isinstance(result, Lost):
        return Outcome(source=name, exit_code=StorageError.exit_code, message=result.reason)
    return result


def _line(outcome: Outcome) -> str:
    if outcome.exit_code:
        return f"{outcome.source}: {outcome.reason}"
    fit = outcome.fit or {}
    return f"{outcome.source}: {fit.get('chosen')}, {fit.get('verdict')}"


def keep_files(folder: Path, outcome: Outcome) -> None:
    """Write the files of a fit into a folder of its own, which is there whole or not at all."""
    final, part = folder / _FITS / outcome.source, folder / ".part"
    try:
        make_folder(final.parent)
        write_files(part, outcome.files)
        part.rename(final)
    except OSError as error:
        raise StorageError(f"{final}: {explain_os_error(error, folder)}") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _order(outcome: Outcome) -> str:
    return outcome.source


def _end(found: Found, outcomes: Sequence[Outcome], many: Many) -> None:
    """Write the table of what is done, and print it."""
    done = sorted(outcomes, key=_order)
    if many.out is not None and done:
        _write_summary(many.out, done)
    if many.as_json:
        print_json(as_json(done, complete=len(done) == len(found.sources)))
        return
    if done:
        header = ("source", "model", "verdict", "rms/mean", "χ²/dof")
        rows = [_row(outcome) for outcome in done]
        print_lines(table_lines(header, rows, out.width, right=False))
    print_notes(f"{outcome.source}: {outcome.reason}" for outcome in done if outcome.exit_code)
    if found.others:
        more = len(found.others) - _MOST_NAMED
        names = ", ".join(found.others[:_MOST_NAMED]) + f" and {more} more" * (more > 0)
        print_notes([f"not read, as neither run nor table: {names}"])


def _write_summary(folder: Path, done: Sequence[Outcome]) -> None:
    path = folder / _SUMMARY
    try:
        make_folder(folder)
    except OSError as error:
        raise StorageError(f"{folder}: {explain_os_error(error, folder.parent)}") from error
    write_whole(path, as_csv(done), new=True)
    console.print(f"table: {path}", highlight=False, soft_wrap=True)


def _row(outcome: Outcome) -> tuple[str, ...]:
    """Cells of a source; the reason of one that failed stands below the table."""
    verdict = str((outcome.fit or {}).get("verdict") or "failed")
    chosen = outcome.chosen
    if chosen is None:
        return outcome.source, "—", verdict, "", ""
    rms, chi2 = chosen["rms_relative"], chosen["reduced_chi2"]
    numbers = ("" if rms is None else f"{100 * rms:.3g} %", "" if chi2 is None else f"{chi2:.3g}")
    return outcome.source, str(chosen["model"]), verdict, *numbers
