"""Command `gonio fit --all`: fits of all sources in a folder, and a table of them."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from acquisition.batch.found import Found, sources_in
from acquisition.batch.summary import Outcome
from acquisition.commands.fit import Asked, require_options
from acquisition.commands.many.each_source import Many, Task, for_each
from acquisition.commands.many.fits_table import as_csv, chosen_of
from acquisition.commands.many.one_fit import fit_one
from acquisition.commands.outcomes.new_folder import require_new_folder, write_files
from acquisition.terminal.console import console
from acquisition.terminal.layout import Row
from instrument.errors import InputError, StorageError
from instrument.text.atomic_file import explain_os_error, make_folder, write_whole

_SUMMARY = "summary.csv"
_FITS = "fits"  # folder of the fits' own folders


def fit_all(folder: Path, asked: Asked, many: Many, new: Path | None) -> None:
    """Fit every run and table in the folder and print a table of the outcomes.

    new: a new folder, for the files of each fit and the table. Raises `InputError` for a wrong
    option or a folder without sources, and as `for_each` does.
    """
    require_options(asked)
    found = _found(folder, new)
    task = Task(
        work=partial(fit_one, asked=asked, report=new is not None),
        keep=lambda outcome, _: outcome if new is None else keep_files(new, outcome),
        line=_line,
        table=_table,
        finish=lambda done: None if new is None else _write_summary(new, done),
        result="fit",
        done="fitted",
        others="not read, as neither run nor table",
    )
    for_each(found, task, many)


def _found(folder: Path, new: Path | None) -> Found:
    """Find the sources, and refuse a new folder that contradicts theirs."""
    found = sources_in(folder)
    if new is not None:
        require_new_folder(new, "--out")
        if new.resolve().is_relative_to(folder.resolve()):
            raise InputError(
                f"--out {new}: is inside {folder}, where the next --all would take its tables "
                "for sources: name a folder elsewhere"
            )
    return found


def _line(outcome: Outcome) -> str:
    fit = outcome.result or {}
    return f"{fit.get('chosen')}, {fit.get('verdict')}"


def keep_files(folder: Path, outcome: Outcome) -> Outcome:
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
    return outcome


def _write_summary(folder: Path, done: Sequence[Outcome]) -> None:
    path = folder / _SUMMARY
    try:
        make_folder(folder)
    except OSError as error:
        raise StorageError(f"{folder}: {explain_os_error(error, folder.parent)}") from error
    write_whole(path, as_csv(done), new=True)
    console.print(f"table: {path}", highlight=False, soft_wrap=True)


def _table(done: Sequence[Outcome]) -> tuple[Row, Sequence[Row]]:
    header = ("source", "model", "verdict", "rms/mean", "χ²/dof")
    return header, [_row(outcome) for outcome in done]


def _row(outcome: Outcome) -> Row:
    """Cells of a source; the reason of one that failed stands below the table."""
    verdict = str((outcome.result or {}).get("verdict") or "failed")
    chosen = chosen_of(outcome)
    if chosen is None:
        return outcome.source, "—", verdict, "", ""
    rms, chi2 = chosen["rms_relative"], chosen["reduced_chi2"]
    numbers = ("" if rms is None else f"{100 * rms:.3g} %", "" if chi2 is None else f"{chi2:.3g}")
    return outcome.source, str(chosen["model"]), verdict, *numbers
