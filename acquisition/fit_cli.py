"""Command that fits models: `gonio fit`, of one source or of all in a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from acquisition.cli_parts import (
    Json,
    Scheduler,
    Workers,
    among,
    model_names,
    refuse_without_all,
)
from instrument.errors import InputError


def fit(
    source: Annotated[
        Path, typer.Argument(help="A run's folder, or a CSV table; with --all, a folder of both.")
    ],
    models: Annotated[
        str | None,
        typer.Option(
            help="Candidate models, separated by commas. Default: those of a run's protocol, else "
            "the whole ladder.",
            autocompletion=model_names,
        ),
    ] = None,
    max_theta_deg: Annotated[
        float, typer.Option(help="Leave out points with a larger theta_i or theta_r (degrees).")
    ] = 90.0,
    format: Annotated[
        str,
        typer.Option(
            help="run, csv, astm, zemax, pab, alta, merl or curet; auto: by content.",
            autocompletion=among(
                ("auto", "run", "csv", "astm", "zemax", "pab", "alta", "merl", "curet")
            ),
        ),
    ] = "auto",
    sample: Annotated[int | None, typer.Option(help="Number of the material, for curet.")] = None,
    robust: Annotated[
        bool, typer.Option("--robust", help="Give outliers less weight, and list them.")
    ] = False,
    relative: Annotated[
        bool,
        typer.Option("--relative", help="The values are relative: no reference fixes their scale."),
    ] = False,
    u_shared: Annotated[
        str | None,
        typer.Option(
            help="Relative u of an error that all values share (0.5% or 0.005), for tables."
        ),
    ] = None,
    repeats: Annotated[
        str | None,
        typer.Option(
            help="mean: average rows of the same geometry, weighted by 1/u². Default: refuse them."
        ),
    ] = None,
    cosine_corrected: Annotated[
        bool,
        typer.Option("--cosine-corrected", help="A table's values are BRDF times cos(theta_r)."),
    ] = False,
    mirror_azimuth: Annotated[
        bool,
        typer.Option("--mirror-azimuth", help="A table's azimuth 0 is the mirror side."),
    ] = False,
    method: Annotated[
        str,
        typer.Option(
            help="Method for rough surfaces: auto, qualitative, functional or exact.",
            autocompletion=among(("auto", "qualitative", "functional", "exact")),
        ),
    ] = "auto",
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="New folder for report.html, fit.json, measurements.csv; with --all, for those of "
            "each source and summary.csv.",
        ),
    ] = None,
    all: Annotated[
        bool, typer.Option("--all", help="Fit every run and table in a folder and its folders.")
    ] = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
    json: Json = False,
) -> None:
    """Find the simplest model that explains a run or a table of BRDF.

    A CSV table has the columns theta_i_deg, theta_r_deg, dphi_deg, brdf and, if known, u_brdf.
    Tables in the text formats of `gonio export` are read too.
    Exits with 0 whether or not a model is adequate, with 5 if the data do not determine the
    parameters. With --all, a source that fails does not end the others; the exit code is that of
    the worst.
    """
    from acquisition.commands.fit import Asked, fit_source, parse_u_shared
    from acquisition.results.sources import Wanted

    wanted = Wanted(
        format=format,
        sample=sample,
        max_theta_deg=max_theta_deg,
        relative=relative,
        u_shared=parse_u_shared(u_shared),
        repeats=repeats,
        cosine_corrected=cosine_corrected,
        mirror_azimuth=mirror_azimuth,
    )
    asked = Asked(wanted=wanted, models=models, robust=robust, method=method)
    if all:
        from acquisition.commands.many.each_source import Many
        from acquisition.commands.many.fit_all import fit_all

        _refuse_for_all(format, sample)
        fit_all(source, asked, Many(workers=workers, scheduler=scheduler, as_json=json), out)
        return
    refuse_without_all(workers, scheduler)
    fit_source(source, asked, folder=out, as_json=json)


def _refuse_for_all(format: str, sample: int | None) -> None:
    """Raise `InputError` for an option that names what one source is."""
    if format != "auto":
        raise InputError(f"--format: {format}; allowed with --all: auto, by each file's content")
    if sample is not None:
        raise InputError(f"--sample: {sample}; a material of the CUReT database is fitted alone")
