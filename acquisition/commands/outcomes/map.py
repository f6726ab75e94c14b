"""Command `gonio map`: albedo and roughness in each place of a run's sample."""

from __future__ import annotations

import json
from collections.abc import Iterator
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
from analysis.sample_maps.files import nexus_bytes, npz_bytes
from analysis.sample_maps.page import map_html
from analysis.sample_maps.sample_map import UNITS, SampleMap
from analysis.sample_maps.sigma_table import MAPPED
from instrument.record.record import Record
from instrument.text.atomic_file import read_file, write_whole

_MOST_BYTES = 32 * 1024**2  # of fit.json
_MOST_REPORT_BYTES = 512 * 1024**2
_DEFAULT = "oren_nayar"


def map_run(
    run: Path, cell_mm: float | None, model: str | None, *, nexus: bool, as_json: bool
) -> None:
    """Map the run's sample, write map.npz and map.html into its folder, and print what it shows.

    model: by default the one that the run's fit chose, if a map can fit it. nexus: map.nxs, too.
    """
    wanted, note = (model, "") if model is not None else _chosen(run)
    require_model(wanted, MAPPED)
    with Record.open(run) as record:
        loaded = load_run_inputs(record)
        with sign_of_life("map of the sample"):
            found = map_sample(record, loaded, wanted, cell_mm)
            report = run / "report.html"
            page = map_html(found, report.name if report.is_file() else None)
            files = {"map.npz": npz_bytes(found), MAP_PAGE: page.encode()}
            if nexus:
                files["map.nxs"] = nexus_bytes(found)
    for name, content in files.items():
        write_whole(run / name, content)
    if report.is_file():
        _link_from(report)
    if as_json:
        print_json({**_json(found), "files": [str(run / name) for name in files]})
        return
    _print(found, note)
    print_lines(["", *(str(run / name) for name in files)])


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


def _json(found: SampleMap) -> dict[str, Any]:
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
