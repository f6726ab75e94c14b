"""Commands `gonio calibrate ...`: arguments and help texts.

Each command imports its module when it is called, so that `gonio --help` loads nothing heavy.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from acquisition.cli_parts import Commands, Json, RigOnly

calibrate = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Measure a rig's devices and write what was found to a file.",
)


@calibrate.command()
def camera(
    rig: RigOnly = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File for the calibration, new, .npz.")
    ] = None,
    plan: Annotated[
        bool, typer.Option("--plan", help="Show what would be measured; opens no device.")
    ] = False,
    exposures: Annotated[int, typer.Option(help="Number of exposures with the lamp lit.")] = 30,
    frames: Annotated[int, typer.Option(help="Frames at each exposure.")] = 4,
    json: Json = False,
) -> None:
    """Calibrate the camera: darks, gain and noise, linearity, hot pixels, flat field.

    The operator places a matt white surface that fills the picture, and covers a lamp that has no
    shutter. Nothing moves. Names and definitions are those of EMVA 1288, release 4.0. Exits with 5
    if the frames do not determine the camera.
    """
    from acquisition.commands.calibrate import calibrate_camera

    calibrate_camera(rig, out, exposures=exposures, frames=frames, plan_only=plan, as_json=json)
