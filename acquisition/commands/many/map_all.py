"""Command `gonio map --all`: maps of all runs in a folder that kept frames or cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from acquisition.batch.found import runs_in
from acquisition.batch.summary import Outcome
from acquisition.commands.many.each_source import Many, Task, for_each
from acquisition.commands.many.one_map import map_one
from acquisition.commands.outcomes.map import Asked, require_options, write_map
from acquisition.measure.rectify.kept_files import has_kept
from acquisition.terminal.layout import Row
from analysis.report.style import short_number
from analysis.sample_maps.sample_map import UNITS
from instrument.errors import GonioError

_KEPT = "kept frames (keep_frames: true in its protocol) or cells (maps: {cell_mm: 0.5})"


def map_all(folder: Path, asked: Asked, many: Many) -> None:
    """Map every run in the folder that has frames or cells, and print a table of the outcomes.

    Each map's files are written into its run's folder. Raises `InputError` for a wrong option or a
    folder without such runs, and as `for_each` does.
    """
    require_options(asked)
    found = runs_in(folder, "map", has_kept, _KEPT)
    task = Task(
        work=partial(map_one, asked=asked),
        keep=_keep,
        line=lambda outcome: _line(outcome.result or {}),
        table=_table,
        result="map",
        done="mapped",
        others="not mapped, as their folders have neither frames nor cells",
    )
    for_each(found, task, many)


def _keep(outcome: Outcome, run: Path) -> Outcome:
    """Write the files into the run's folder; where that fails, other runs may have other disks."""
    try:
        written = write_map(run, outcome.files)
    except GonioError as error:
        return Outcome(source=outcome.source, exit_code=error.exit_code, message=str(error))
    return replace(outcome, result={**(outcome.result or {}), "files": written})


def _line(found: Mapping[str, Any]) -> str:
    varies = _varies(found)
    return f"{found['model']}, " + (f"not uniform: {varies}" if varies else "uniform")


def _varies(found: Mapping[str, Any]) -> str:
    """Names of the parameters in which the cells differ."""
    return ", ".join(n for n, own in found["parameters"].items() if own["uniform"] is False)


def _table(done: Sequence[Outcome]) -> tuple[Row, Sequence[Row]]:
    seen = {name for o in done if o.result is not None for name in o.result["parameters"]}
    names = [name for name in UNITS if name in seen]
    header = ("source", "model", "cells", *names, "varies in", "rejected")
    return header, [_row(outcome, names) for outcome in done]


def _row(outcome: Outcome, names: Sequence[str]) -> Row:
    """Cells of a run, its medians among them; the reason of one that failed is told elsewhere."""
    found = outcome.result
    if found is None:
        return outcome.source, "failed", "", *("" for _ in names), "", ""
    medians = [_median(found["parameters"].get(name), UNITS[name]) for name in names]
    rejected = f"{short_number(100 * found['rejected_share'], 3)} %"
    size = f"{found['cell_mm']:g} mm"
    return outcome.source, found["model"], size, *medians, _varies(found) or "nothing", rejected


def _median(own: Mapping[str, Any] | None, unit: str) -> str:
    median = None if own is None else own["median"]
    return "" if median is None else f"{short_number(median, 3)}{unit}"
