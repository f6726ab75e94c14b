"""The command line, `gonio`. Heavy imports wait until a command needs them."""

from __future__ import annotations

import importlib
import math
import os
import signal
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from instrument.errors import GonioError, OperatorStop, StorageError
from instrument.text.terminal_safe import escape_control_characters

# The program's arrays are small: threads of the linear algebra would only wait for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

STOPPING_S = 2.0  # that stopping all devices may take

app = typer.Typer(
    help="Measure how a flat sample reflects light, and find the simplest model that explains it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

ProtocolFile = Annotated[Path, typer.Argument(help="The protocol, a YAML file.")]
RigFile = Annotated[
    Path | None, typer.Option("--rig", help="A rig file in place of the one the protocol names.")
]
RunFolder = Annotated[Path, typer.Argument(help="The folder of a run.")]
OutFolder = Annotated[
    Path | None,
    typer.Option("--out", help="The run's folder, absent or empty. Default: runs/NAME-DATE-TIME."),
]
Json = Annotated[
    bool, typer.Option("--json", help="Print the result as JSON, and nothing else, on stdout.")
]


@app.command()
def run(
    protocol: ProtocolFile, rig: RigFile = None, out: OutFolder = None, json: Json = False
) -> None:
    """Run a scan from a protocol: measure, fit, report."""
    _do("run_protocol", protocol, rig, out, json)


@app.command()
def plan(protocol: ProtocolFile, rig: RigFile = None, json: Json = False) -> None:
    """Show what a scan would do and how long it takes; no device is touched."""
    _do("show_plan", protocol, rig, json)


@app.command()
def resume(
    folder: RunFolder,
    yes: Annotated[
        bool, typer.Option("--yes", help="The rig is ready to move: do not ask.")
    ] = False,
    json: Json = False,
) -> None:
    """Go on with a run that was stopped, at the first geometry that is not in its record."""
    _do("resume_run", folder, yes, json)


@app.command()
def fit(
    source: Annotated[Path, typer.Argument(help="A run's folder, or a CSV table.")],
    models: Annotated[
        str | None,
        typer.Option(help="Candidates, parted by commas. Default: the ladder from Lambert up."),
    ] = None,
    max_theta_deg: Annotated[
        float, typer.Option(help="Leave out points with a larger theta_i or theta_r.")
    ] = 90.0,
    format: Annotated[
        str, typer.Option(help="run, csv or curet; auto: a run's folder, else a CSV.")
    ] = "auto",
    sample: Annotated[int | None, typer.Option(help="Which material of a curet folder.")] = None,
    robust: Annotated[
        bool, typer.Option("--robust", help="Outliers count less, and are named.")
    ] = False,
    relative: Annotated[
        bool, typer.Option("--relative", help="The values are tied to no reference.")
    ] = False,
    method: Annotated[
        str,
        typer.Option(help="For rough surfaces: auto, qualitative, functional or exact."),
    ] = "auto",
    json: Json = False,
) -> None:
    """Find the simplest model that explains a run or a CSV table of BRDF.

    A CSV has the columns theta_i_deg, theta_r_deg, dphi_deg, brdf and, where it is known, u_brdf.
    Ends with 0 whether a model is adequate or none is, with 5 where the data do not determine the
    parameters.
    """
    wanted = (format, sample, max_theta_deg, relative)
    asked = (source, models, robust, json, method, *wanted)
    _do("fit_source", *asked, module="acquisition.commands.fit")


@app.command()
def report(folder: RunFolder, json: Json = False) -> None:
    """Fit a finished run again and write its tables and its report anew."""
    _do("report_run", folder, json)


RigOnly = Annotated[Path | None, typer.Option("--rig", help="The rig file.")]
Yes = Annotated[bool, typer.Option("--yes", help="The rig is clear and may move: do not ask.")]
AxisName = Annotated[str, typer.Argument(help="theta_i, dphi or theta_r.")]
_BENCH = "acquisition.commands.setup"


@app.command()
def devices(
    rig: RigOnly = None,
    identify: Annotated[
        bool, typer.Option("--identify", help="Ask every serial port who is there.")
    ] = False,
) -> None:
    """List serial ports and cameras; with --rig, open the rig's devices and say who answers.

    --identify sends each known controller's question to every port: not to ports of other machines.
    """
    _do("list_devices", rig, identify, module=_BENCH)


@app.command()
def home(axis: AxisName, rig: RigOnly = None, yes: Yes = False) -> None:
    """Have an axis look for its reference. It moves."""
    _do("home_axis", axis, rig, yes, module=_BENCH)


@app.command(context_settings={"ignore_unknown_options": True})
def move(
    axis: AxisName,
    angle_deg: Annotated[float, typer.Argument(help="Where to, in the rig's degrees.")],
    rig: RigOnly = None,
    yes: Yes = False,
) -> None:
    """Move one axis, after homing. Keep-out zones are not checked: only one axis is known."""
    _do("move_axis", axis, angle_deg, rig, yes, module=_BENCH)


@app.command()
def grab(
    out: Annotated[Path, typer.Option("--out", "-o", help="A .png (drawn on) or .tiff (raw).")],
    rig: RigOnly = None,
    protocol: Annotated[
        Path | None, typer.Option(help="Take rig and measuring window from this protocol.")
    ] = None,
    theta_r_deg: Annotated[
        float, typer.Option(help="Where the camera stands, for the window's outline.")
    ] = 0.0,
    exposure_s: Annotated[
        float | None, typer.Option(help="Exposure in seconds. Default: the camera's shortest.")
    ] = None,
    json: Json = False,
) -> None:
    """Take one frame for aiming, with the measuring window drawn on it. Nothing moves."""
    _do("grab_frame", rig, protocol, theta_r_deg, exposure_s, out, json, module=_BENCH)


@app.command()
def bench(
    out: Annotated[Path, typer.Option("--out", help="The folder to write, absent or empty.")],
    quick: Annotated[
        bool, typer.Option("--quick", help="A minute instead of a quarter of an hour.")
    ] = False,
    maps: Annotated[
        bool, typer.Option("--maps", help="Also map where methods fail; takes longer.")
    ] = False,
) -> None:
    """Measure on this machine what accuracy costs, method by method, and chart it."""
    _do("run_bench", out, quick, maps, module="acquisition.benchmark.command")


def main() -> None:
    """Entry point of the `gonio` command."""
    stop_on_signals()
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(OperatorStop.exit_code)


def stop_on_signals() -> None:
    """Let Ctrl-C and SIGTERM end what runs; a second one soon after must not cut the stop short."""
    last_s = -math.inf

    def interrupt(number: int, frame: object) -> None:  # noqa: ARG001 - a signal handler's form
        nonlocal last_s
        soon, last_s = time.monotonic() - last_s < STOPPING_S, time.monotonic()
        if not soon:
            raise KeyboardInterrupt

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, interrupt)


def _do(command: str, *arguments: object, module: str = "acquisition.commands.scan") -> None:
    """Run a module's command; what can go wrong becomes a message and an exit code."""
    try:
        getattr(importlib.import_module(module), command)(*arguments)
    except GonioError as error:
        sys.stderr.write(f"{escape_control_characters(str(error))}\n")
        raise typer.Exit(error.exit_code) from None
    except OSError as error:
        sys.stderr.write(f"{escape_control_characters(str(error))}\n")
        raise typer.Exit(StorageError.exit_code) from None
    except KeyboardInterrupt:
        sys.stderr.write("stopped by the operator\n")
        raise typer.Exit(OperatorStop.exit_code) from None
