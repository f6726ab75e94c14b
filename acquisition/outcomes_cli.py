"""Commands about runs that have been measured: export, compare, runs, map, show."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from acquisition.cli_parts import Json, RunFolder, Scheduler, Workers, refuse_without_all


def _format_names(incomplete: str) -> list[str]:
    """Completion in the shell of formats of files."""
    from analysis.exchange.formats import FORMATS

    return [name for name in (*FORMATS, "documents", "tiled") if name.startswith(incomplete)]


def export(
    folder: RunFolder,
    format: Annotated[
        str,
        typer.Option(
            "--format",
            help="Format of the file: csv, astm, zemax, pab, alta, nexus, merl, mitsuba, "
            "radiance, openmaterial; documents of bluesky (.jsonl), or a tiled server.",
            autocompletion=_format_names,
        ),
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File to write; not for tiled.")
    ] = None,
    to: Annotated[
        str | None,
        typer.Option(help="Address of a Tiled server, for tiled; its key may be in TILED_API_KEY."),
    ] = None,
) -> None:
    """Write a run in the format of another program; points with a flag are left out.

    What is interpolated or modelled is marked as such. No file is written where the format cannot
    hold the run.
    """
    from acquisition.commands.outcomes.export import export_to

    export_to(folder, format, output, to)


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


def map_(
    folder: Annotated[
        Path, typer.Argument(help="The folder of a run; with --all, a folder of runs.")
    ],
    cell_mm: Annotated[
        float | None,
        typer.Option(help="Side of a cell in mm. Default: 0.5, or a pixel where that is larger."),
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(
            help="Model for each cell: oren_nayar, oren_nayar_exact, oren_nayar_qualitative, alone "
            "or with +torrance_sparrow. Default: that of the run's fit."
        ),
    ] = None,
    nexus: Annotated[bool, typer.Option("--nexus", help="Write map.nxs, too (h5py).")] = False,
    all: Annotated[
        bool,
        typer.Option("--all", help="Map every run with frames or cells in a folder and below."),
    ] = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
    json: Json = False,
) -> None:
    """Map albedo and roughness over the sample of a run that kept its frames.

    Writes map.npz and map.html into the run's folder, and tells whether the sample is uniform.
    With --all, a run that fails does not end the others; the exit code is that of the worst.
    """
    from acquisition.commands.outcomes.map import Asked, map_run

    asked = Asked(cell_mm=cell_mm, model=model, nexus=nexus)
    if all:
        from acquisition.commands.many.each_source import Many
        from acquisition.commands.many.map_all import map_all

        map_all(folder, asked, Many(workers=workers, scheduler=scheduler, as_json=json))
        return
    refuse_without_all(workers, scheduler)
    map_run(folder, asked, as_json=json)


def show(
    source: Annotated[
        str,
        typer.Argument(
            help="A run's folder, a fit.json, a table, or a model: oren_nayar:sigma_deg=40."
        ),
    ],
    out: Annotated[
        Path,
        typer.Option("--out", "-o", help="Page to write (.html), or the pictures alone (.png)."),
    ] = Path("show.html"),
    lamp: Annotated[
        list[str] | None,
        typer.Option(
            help="Lamp at THETA or THETA,PHI degrees: from the viewer, and azimuth (0 right, 90 "
            "above). May be repeated."
        ),
    ] = None,
    size_px: Annotated[int, typer.Option(help="Width of a picture in pixels.")] = 200,
    noise: Annotated[
        str | None,
        typer.Option(
            help="Relative u of the brightest pixel (0.5% or 0.005). Default: that of the run's "
            "camera, else 0.5%."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Show a material on a sphere, a vase, a cylinder and a cube, beside Lambert's law.

    The page has brightness across the vase, isophotes, reflectance maps and lobes, and tells what
    Lambert's law would cost in normals and depth.
    """
    from acquisition.commands.outcomes.show import Asked, show_material

    asked = Asked(page=out, lamps=lamp or (), size_px=size_px, noise=noise)
    show_material(source, asked, as_json=json)
