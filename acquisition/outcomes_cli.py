"""Commands about runs that have been measured: export, compare, runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from acquisition.cli_parts import Json, RunFolder


def _format_names(incomplete: str) -> list[str]:
    """Completion in the shell of formats of files."""
    from analysis.exchange.formats import FORMATS

    return [name for name in FORMATS if name.startswith(incomplete)]


def export(
    folder: RunFolder,
    format: Annotated[
        str,
        typer.Option(
            "--format",
            help="Format of the file: csv, astm, zemax, pab, alta, nexus, merl, mitsuba, "
            "radiance, openmaterial.",
            autocompletion=_format_names,
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="File to write.")],
) -> None:
    """Write a run in the format of another program; points with a flag are left out.

    What is interpolated or modelled is marked as such. No file is written where the format cannot
    hold the run.
    """
    from acquisition.commands.outcomes.export import export_run

    export_run(folder, format, output)


def compare(
    sources: Annotated[list[Path], typer.Argument(help="Two or more runs, or tables with u_brdf.")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Page with charts to write (.html).")
    ] = None,
    json: Json = False,
) -> None:
    """Compare runs at the geometries that all have: whether they agree, level, scatter.

    An error that runs share, as that of one white tile, cannot make them differ.
    """
    from acquisition.commands.outcomes.compare import compare_sources

    compare_sources(sources, out, as_json=json)


def runs(
    folder: Annotated[
        Path, typer.Argument(help="Folder that holds the runs. Default: runs.")
    ] = Path("runs"),
    json: Json = False,
) -> None:
    """List the runs of a folder with their state, sample and verdict."""
    from acquisition.commands.outcomes.runs import list_runs

    list_runs(folder, as_json=json)
