"""Command `gonio plan`: a scan as it is written, or the geometries that teach most."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from acquisition.cli_parts import Json, ProtocolFile, RigFile
from instrument.errors import InputError


def plan(
    protocol: ProtocolFile,
    rig: RigFile = None,
    optimal: Annotated[
        int | None,
        typer.Option(min=1, help="Choose so many geometries that determine the parameters best."),
    ] = None,
    until: Annotated[
        str | None,
        typer.Option(
            help="Choose the fewest that reach these u, as sigma_deg=0.2,albedo=0.005.",
        ),
    ] = None,
    wanted: Annotated[
        str | None,
        typer.Option(
            "--for",
            help="Parameters to choose for, separated by commas. Default: all of the model.",
        ),
    ] = None,
    like: Annotated[
        str | None,
        typer.Option(
            help="Sample to choose for: MODEL:NAME=VALUE,..., a run's folder or a fit.json. "
            "Default: the protocol's simulated_sample."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Protocol to write with them (.yaml).")
    ] = None,
    chart: Annotated[
        Path | None,
        typer.Option(help="Picture to write: bench minutes against u (.png, .svg or .pdf)."),
    ] = None,
    json: Json = False,
) -> None:
    """Show the geometries and the duration of a scan; opens no device.

    With --optimal or --until: a few geometries among those of the protocol's sweeps, what each is
    for, and the u that they will give, beside the sweeps.
    """
    if until is not None and (optimal is not None or wanted is not None):
        other = "--optimal" if optimal is not None else "--for"
        raise InputError(f"gonio plan: {other}: not allowed with --until, which says how many")
    if optimal is None and until is None:
        options = {"--for": wanted, "--like": like, "--out": out, "--chart": chart}
        given = [name for name, value in options.items() if value is not None]
        if given:
            raise InputError(
                f"gonio plan: {', '.join(given)}: allowed with --optimal N or --until only"
            )
        from acquisition.commands.scan import show_plan

        show_plan(protocol, rig, as_json=json)
        return
    from acquisition.commands.planning.optimal import OptimalOptions, show_optimal_plan

    chosen = OptimalOptions(
        count=optimal, until=until, wanted=wanted, like=like, out=out, chart=chart
    )
    show_optimal_plan(protocol, rig, chosen, as_json=json)
