"""Command line of the program, `gonio`: arguments, help texts, errors as exit codes.

Each command imports its module when it is called, so that `gonio --help` loads nothing heavy.
"""

from __future__ import annotations

import gc
import os
import platform
import sys
from pathlib import Path
from typing import Annotated

import typer

from acquisition.calibrate_cli import calibrate
from acquisition.cli_parts import (
    Commands,
    Json,
    ProtocolFile,
    RigFile,
    RigOnly,
    RunFolder,
    among,
    model_names,
)
from acquisition.fit_cli import fit
from acquisition.gallery_cli import gallery
from acquisition.new_cli import new
from acquisition.outcomes_cli import compare, export, map_, runs, show
from acquisition.plan_cli import plan
from acquisition.terminal import stop_signals
from acquisition.terminal.streams import lasting_streams
from instrument.errors import InputError, StorageError

# The program's arrays are small: several threads in linear algebra would only cost time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.add_typer(calibrate, name="calibrate")
app.add_typer(new, name="new")

_AXES = ("theta_i", "dphi", "theta_r")


OutFolder = Annotated[
    Path | None,
    typer.Option(
        "--out", help="Folder for the run, absent or empty. Default: runs/NAME-DATE-TIME."
    ),
]
Yes = Annotated[bool, typer.Option("--yes", help="The rig is clear and may move: do not ask.")]
Live = Annotated[
    bool, typer.Option("--live", help="Show the scan in a browser; prints the page's address.")
]
AxisName = Annotated[
    str,
    typer.Argument(help="theta_i, dphi or theta_r.", autocompletion=among(_AXES)),
]


def _print_version(wanted: bool) -> None:
    if wanted:
        from acquisition.results.versions import versions_of

        number = versions_of("gonio")["gonio"]
        typer.echo(f"gonio {number} (Python {platform.python_version()})")
        raise typer.Exit


@app.callback()
def common(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    """Measure how a flat sample reflects light, and find the simplest model that explains it."""


@app.command()
def run(
    protocol: ProtocolFile,
    rig: RigFile = None,
    out: OutFolder = None,
    until: Annotated[
        str | None,
        typer.Option(
            help="Choose geometries of the sweeps until these u are reached, as sigma_deg=0.2."
        ),
    ] = None,
    budget_min: Annotated[
        float | None, typer.Option(help="Bench time with --until, or a goal, in minutes.")
    ] = None,
    live: Live = False,
    json: Json = False,
) -> None:
    """Run a scan from a protocol: measure, fit and report.

    In a terminal, the key p pauses the scan and lets it go on. With --until, or a goal in the
    protocol, it chooses what to measure next from what it has measured.
    """
    from acquisition.commands.scan import run_protocol

    run_protocol(protocol, rig, out, live=live, as_json=json, until=until, budget_min=budget_min)


app.command()(plan)


@app.command()
def resume(folder: RunFolder, yes: Yes = False, live: Live = False, json: Json = False) -> None:
    """Resume a stopped run at the first geometry that is missing in its record."""
    from acquisition.commands.scan import resume_run

    resume_run(folder, yes=yes, live=live, as_json=json)


app.command()(fit)


@app.command()
def models(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="Models or sums of them. Default: all single ones.", autocompletion=model_names
        ),
    ] = None,
    json: Json = False,
) -> None:
    """List the reflectance models with their parameters, and the candidates of a fit."""
    from acquisition.commands.models import list_models

    list_models(names or [], as_json=json)


@app.command()
def report(
    folder: RunFolder,
    pdf: Annotated[
        bool, typer.Option("--pdf", help="Print it to report.pdf, too; needs a Chromium.")
    ] = False,
    figures: Annotated[
        Path | None,
        typer.Option("--figures", help="New folder for its figures as SVG, their data as CSV."),
    ] = None,
    json: Json = False,
) -> None:
    """Fit a run again and rewrite its table and its report."""
    from acquisition.commands.scan import report_run

    report_run(folder, pdf=pdf, figures=figures, as_json=json)


app.command("map")(map_)
for command in (export, compare, runs, show, gallery):
    app.command()(command)


@app.command()
def watch(
    folder: RunFolder,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port of this computer; 0: a free one.")
    ] = 0,
) -> None:
    """Show a run in the browser, as it grows or afterwards, until Ctrl-C.

    Prints the address of the page, which only this computer reaches. Pause, Resume and Abort are
    there while the scan runs.
    """
    from acquisition.live.watch import watch_run

    watch_run(folder, port)


@app.command()
def devices(
    rig: RigOnly = None,
    identify: Annotated[
        bool, typer.Option("--identify", help="Query every serial port for known controllers.")
    ] = False,
) -> None:
    """List serial ports and cameras; with --rig, open the rig's devices and identify them.

    --identify sends the query of every known controller to every port: do not use it while other
    machines are connected.
    """
    from acquisition.commands.setup import list_devices

    list_devices(rig, identify=identify)


@app.command()
def home(axis: AxisName, rig: RigOnly = None, yes: Yes = False) -> None:
    """Home an axis: it moves until it has found its reference."""
    from acquisition.commands.setup import home_axis

    home_axis(axis, rig, yes=yes)


@app.command(context_settings={"ignore_unknown_options": True})
def move(
    axis: AxisName,
    angle_deg: Annotated[float, typer.Argument(help="Target angle in degrees of the rig.")],
    rig: RigOnly = None,
    yes: Yes = False,
) -> None:
    """Move one homed axis. Keep-out zones are not checked: the other axes are not read."""
    from acquisition.commands.setup import move_axis

    move_axis(axis, angle_deg, rig, yes=yes)


@app.command()
def grab(
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="File: .png (8 bit, with the window) or .tiff (raw counts)."
        ),
    ] = None,
    live: Annotated[
        bool,
        typer.Option(
            "--live", help="Show the picture in a browser, with focus and saturation, until Ctrl-C."
        ),
    ] = False,
    rig: RigOnly = None,
    protocol: Annotated[
        Path | None, typer.Option(help="Take rig and measuring window from this protocol.")
    ] = None,
    theta_r_deg: Annotated[
        float, typer.Option(help="View angle of the camera in degrees, for the outline.")
    ] = 0.0,
    exposure_s: Annotated[
        float | None, typer.Option(help="Exposure in seconds. Default: one that suits the window.")
    ] = None,
    json: Json = False,
) -> None:
    """Take one frame with the measuring window drawn on it, for aiming. Nothing moves.

    With --live the picture is shown in a browser while the camera is aimed and the lens turned.
    """
    from acquisition.commands.grab import aim_camera, grab_frame

    if live and (out is not None or json):
        raise InputError(
            "gonio grab: --live shows the picture in a browser and writes nothing: "
            "leave out --out and --json, or --live"
        )
    if live:
        aim_camera(rig, protocol, theta_r_deg=theta_r_deg, exposure_s=exposure_s)
    else:
        grab_frame(out, rig, protocol, theta_r_deg=theta_r_deg, exposure_s=exposure_s, as_json=json)


@app.command()
def bench(
    out: Annotated[Path, typer.Option("--out", help="Folder for the results, absent or empty.")],
    quick: Annotated[
        bool, typer.Option("--quick", help="Take a minute instead of a quarter of an hour.")
    ] = False,
    maps: Annotated[
        bool, typer.Option("--maps", help="Also map where each method fails; takes longer.")
    ] = False,
) -> None:
    """Measure and chart speed against accuracy, for each method, on this machine."""
    from acquisition.benchmark.command import run_benchmark

    run_benchmark(out, quick, maps)


def main() -> None:
    """Run the command line, for which `acquisition.entry` has begun with its signals."""
    if not stop_signals.begun():  # a script `gonio` of an older installation calls this directly
        stop_signals.begin()
    # Hardly any object is part of a cycle: rarer collections save a tenth of a short run.
    gc.set_threshold(100_000, 20, 20)
    try:
        with lasting_streams():
            app()
    except StorageError as error:  # of the help, and of the last flush
        sys.stderr.write(f"{error}\n")
        sys.exit(error.exit_code)
