"""Command `gonio runs`: the runs of a folder with their state, sample and verdict."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from acquisition.commands.fit_status import print_json
from acquisition.results.run_folder import load_run_inputs
from acquisition.terminal.console import out, print_lines, print_notes, print_text
from acquisition.terminal.layout import table_lines
from instrument.errors import GonioError, InputError
from instrument.record.reading import batches_of
from instrument.record.record import FILE_NAME, Record
from instrument.text.atomic_file import read_file
from instrument.text.quoting import printable

_MOST_BYTES = 32 * 1024**2  # of fit.json
_NOT_FITTED = "not fitted"


@dataclass(frozen=True, slots=True, kw_only=True)
class Listed:
    """One run, as the list shows it.

    readings, planned: numbers of steps, references among them; of a scan that still chooses its
    geometries, planned is None. model, verdict: those of fit.json, None without one. refused: why
    the run cannot be read, empty if it can.
    """

    run: str
    started_utc: str = ""
    sample: str = ""
    readings: int = 0
    planned: int | None = 0
    model: str | None = None
    verdict: str | None = None
    refused: str = ""

    @property
    def state(self) -> str:
        """State of the scan: complete, or the readings made so far."""
        if self.refused:
            return "unreadable"
        if self.planned is None:
            return f"{self.readings} so far"
        done = self.planned and self.readings >= self.planned
        return "complete" if done else f"{self.readings} of {self.planned}"


def list_runs(folder: Path, *, as_json: bool) -> None:
    """Print the runs in `folder`, the oldest first; one that cannot be read is listed with why.

    Raises `InputError` for a folder that is missing or holds no run.
    """
    found = sorted(runs_in(folder), key=lambda run: (run.refused != "", run.started_utc, run.run))
    if as_json:
        print_json({"runs": [{**asdict(run), "state": run.state} for run in found]})
        return
    header = ("run", "started", "sample", "state", "adequate model, or verdict")
    print_lines(table_lines(header, [_row(run) for run in found], out.width, right=False))
    unfinished = [run for run in found if not run.refused and run.state != "complete"]
    if unfinished:
        names = ", ".join(run.run for run in unfinished)
        print_text(f"not complete: {names}; go on with: gonio resume RUN")
    print_notes(f"{run.run}: {run.refused}" for run in found if run.refused)


def runs_in(folder: Path) -> Iterator[Listed]:
    """Yield the runs among the folders in `folder`, or the one that it is itself."""
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; name the one that holds the runs")
    inside = [folder] if (folder / FILE_NAME).is_file() else sorted(folder.iterdir())
    runs = [one for one in inside if (one / FILE_NAME).is_file()]
    if not runs:
        raise InputError(f"{folder}: holds no run, which is a folder with {FILE_NAME}")
    return (listed(one) for one in runs)


def listed(run: Path) -> Listed:
    """Return what the list shows of a run; nothing that is wrong with it raises an error."""
    name = printable(run.name or str(run))
    try:
        with Record.open(run) as record:
            loaded = load_run_inputs(record)
            started, readings = record.meta("started_utc") or "", len(record.readings())
            choices = batches_of(record.events())
            chooses = bool(choices) and not choices[-1].end
            planned = None if chooses else int(record.meta("steps") or 0)
    except (GonioError, ValueError) as error:
        return Listed(run=name, refused=str(error))
    model, verdict = _fit_of(run)
    return Listed(
        run=name,
        started_utc=started,
        sample=loaded.protocol.sample.name,
        readings=readings,
        planned=planned,
        model=model,
        verdict=verdict,
    )


def _fit_of(run: Path) -> tuple[str | None, str | None]:
    """Model and verdict of fit.json; None, None where it is missing or is none."""
    try:
        found: Any = json.loads(read_file(run / "fit.json", _MOST_BYTES))
        chosen, verdict = found["chosen"], found["verdict"]
    except (GonioError, OSError, ValueError, LookupError, TypeError, RecursionError):
        return None, None
    texts = [printable(t) if isinstance(t, str) else None for t in (chosen, verdict)]
    return texts[0], texts[1]


def _row(run: Listed) -> tuple[str, ...]:
    """Cells of a run: where no model is adequate, the verdict says more than a name."""
    fit = (run.model if run.verdict == "adequate" else run.verdict) or _NOT_FITTED
    return (run.run, run.started_utc[:10], run.sample, run.state, "" if run.refused else fit)
