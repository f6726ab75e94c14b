"""Command `gonio map`: albedo and roughness in each place of a run's sample."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acquisition.commands.fit_status import print_json
from acquisition.results.maps.sample_map import map_sample, require_model
from acquisition.results.run_folder import load_run_inputs
from acquisition.terminal.console import out, print_lines, print_notes, print_text
from acquisition.terminal.layout import table_lines
from acquisition.terminal.progress import sign_of_life
from analysis.report.page import MAP_PAGE, with_map
from analysis.report.style import format_value, short_number
from analysis.sample_maps.files import nexus_bytes, npz_bytes, require_nexus
from analysis.sample_maps.page import map_html
from analysis.sample_maps.sample_map import UNITS, SampleMap
from analysis.sample_maps.sigma_table import MAPPED
from instrument.record.record import Record
from instrument.text.atomic_file import read_file, write_whole

_MOST_BYTES = 32 * 1024**2  # of fit.json
_MOST_REPORT_BYTES = 512 * 1024**2
_DEFAULT = "oren_nayar"
_REPORT = "report.html"

SignOfLife = Callable[[str], AbstractContextManager[None]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """Request for a map, as the options of the command have it.

    cell_mm: side of a cell; None for the usual one. model: None for the one that the run's fit
    chose, if a map can fit it. nexus: map.nxs, too.
    """

    cell_mm: float | None = None
    model: str | None = None
    nexus: bool = False


@dataclass(frozen=True, slots=True)
class Mapped:
    """Map of a run with the content of its files by name; note: on the choice of its model."""

    found: SampleMap
    files: Mapping[str, bytes]
    note: str


def map_run(run: Path, asked: Asked, *, as_json: bool) -> None:
    """Map the run's sample, write map.npz and map.html into its folder, and print what it shows."""
    require_options(asked)
    mapped = map_of(run, asked, sign_of_life)
    written = write_map(run, mapped.files)
    if as_json:
        print_json({**map_json(mapped.found), "files": written})
        return
    _print(mapped.found, mapped.note)
    print_lines(["", *written])


def require_options(asked: Asked) -> None:
    """Raise `InputError` for an option that is wrong for every run."""
    if asked.model is not None:
        require_model(asked.model, MAPPED)
    if asked.nexus:
        require_nexus()


def map_of(run: Path, asked: Asked, sign: SignOfLife) -> Mapped:
    """Map the run's sample; `sign` shows that it is under way. Raises as `map_sample` does."""
    model, note = (asked.model, "") if asked.model is not None else _chosen(run)
    with Record.open(run) as record:
        loaded = load_run_inputs(record)
        with sign("map of the sample"):
            found = map_sample(record, loaded, model, asked.cell_mm)
            page = map_html(found, _REPORT if (run / _REPORT).is_file() else None)
            files = {"map.npz": npz_bytes(found), MAP_PAGE: page.encode()}
            if asked.nexus:
                files["map.nxs"] = nexus_bytes(found)
    return Mapped(found, files, note)


def write_map(run: Path, files: Mapping[str, str | bytes]) -> list[str]:
    """Write the files of a map into the run's folder, and return their paths."""
    for name, content in files.items():
        write_whole(run / name, content)
    if (run / _REPORT).is_file():
        _link_from(run / _REPORT)
    return [str(run / name) for name in files]


def _link_from(report: Path) -> None:
    """Let the report of the run link to the map; a file that is no text is no report."""
    try:
        page = read_file(report, _MOST_REPORT_BYTES).decode()
    except (OSError, ValueError):
        return
    write_whole(report, with_map(page))


def _chosen(run: Path) -> tuple[str, str]:
    """Return the model that the run's fit chose, or another one and why."""
    try:
        chosen = json.loads(read_file(run / "fit.json", _MOST_BYTES))["chosen"]
    except (OSError, ValueError, KeyError, TypeError):
        return _DEFAULT, f"the run has no fit.json: {_DEFAULT} is mapped; --model names another"
    if chosen in MAPPED:
        return str(chosen), ""
    return _DEFAULT, (
        f"the fit of the run chose a model that cannot be mapped: {_DEFAULT} is; --model names "
        "another"
    )


def _print(found: SampleMap, note: str) -> None:
    rows, columns = found.chi2.shape
    print_text(found.headline())
    header = ("", "median", "scatter", "of u", "beyond u", "mean curve ± u")
    print_lines(["", *table_lines(header, list(_rows(found)), out.width), ""])
    rejected = f"{short_number(100 * found.rejected_share, 3)} % of the cells"
    print_notes(
        (
            f"{columns} × {rows} cells of {found.cell_mm:g} mm, {found.model} in each, at up to "
            f"{found.geometries} geometries",
            f"the model does not hold in {rejected} (0.1 % by chance)",
            note,
            *found.notes,
        )
    )


def _rows(found: SampleMap) -> Iterator[tuple[str, ...]]:
    for name in found.values:
        spread, (value, u) = found.spread(name), found.mean[name]
        if spread is None:
            continue
        numbers = (spread.median, spread.scatter, spread.explained, spread.beyond)
        unit = UNITS[name]
        texts = (f"{short_number(number, 3)}{unit}" for number in numbers)
        yield (name, *texts, format_value(value, u, unit))


def map_json(found: SampleMap) -> dict[str, Any]:
    """Content of the output of --json, but for the names of files."""
    rows, columns = found.chi2.shape
    parameters = {}
    for name in found.values:
        spread, (value, u) = found.spread(name), found.mean[name]
        parameters[name] = {
            "median": None if spread is None else spread.median,
            "scatter": None if spread is None else spread.scatter,
            "explained_by_u": None if spread is None else spread.explained,
            "beyond_u": None if spread is None else spread.beyond,
            "uniform": None if spread is None else spread.uniform,
            "mean_curve": {"value": value, "u": u},
        }
    return {
        "model": found.model,
        "cell_mm": found.cell_mm,
        "rows": rows,
        "columns": columns,
        "geometries": found.geometries,
        "relative": found.relative,
        "uniform": found.uniform,
        "fitted_cells": int(found.fitted.sum()),
        "rejected_share": found.rejected_share,
        "parameters": parameters,
        "notes": list(found.notes),
    }
