"""Commands `gonio calibrate ...`: arguments and help texts.

Each command imports its module when it is called, so that `gonio --help` loads nothing heavy.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from acquisition.cli_parts import Commands, Json, RigOnly

CalibrationFile = Annotated[
    Path | None, typer.Option("--out", "-o", help="File for the calibration, new, .npz.")
]
PlanOnly = Annotated[
    bool, typer.Option("--plan", help="Show what would be measured; opens no device.")
]

Columns = Annotated[int, typer.Option(help="Squares of the board side by side.")]
Rows = Annotated[int, typer.Option(help="Squares of the board one below the other.")]
SquareMm = Annotated[
    float, typer.Option(help="Side of a square, as measured on the print by a ruler.")
]

calibrate = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Measure a rig's devices and write what was found to a file.",
)


@calibrate.command()
def camera(
    rig: RigOnly = None,
    out: CalibrationFile = None,
    plan: PlanOnly = False,
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


@calibrate.command()
def lamp(
    rig: RigOnly = None,
    out: CalibrationFile = None,
    plan: PlanOnly = False,
    minutes: Annotated[float, typer.Option(help="Longest time to watch the lamp.")] = 30.0,
    every_s: Annotated[float, typer.Option(help="Seconds between two readings.")] = 10.0,
    frames: Annotated[int, typer.Option(help="Frames of each reading.")] = 4,
    limit_percent: Annotated[
        float, typer.Option(help="Change of the light that a steady lamp does not exceed ...")
    ] = 0.2,
    within_minutes: Annotated[
        float, typer.Option(help="... within this time: between two drift checks; 60: an hour.")
    ] = 10.0,
    window_mm: Annotated[float, typer.Option(help="Side of the square that is watched.")] = 20.0,
    tile_mm: Annotated[float, typer.Option(help="Side of the white tile.")] = 50.0,
    theta_i_deg: Annotated[float, typer.Option(help="Where the lamp stands, with dphi 0.")] = 30.0,
    theta_r_deg: Annotated[float, typer.Option(help="Where the camera stands.")] = 0.0,
    json: Json = False,
) -> None:
    """Calibrate the lamp: warm-up, drift, flicker, and uniformity over the sample.

    Watches a white tile and ends once the lamp is steady, or after --minutes. The operator places
    the tile, and covers a lamp that has no shutter; nothing moves. Exits with 0 whether or not the
    lamp became steady, with 5 if there is no light or saturation, with 3 if the lamp goes out or
    jumps.
    """
    from acquisition.commands.calibrate import calibrate_lamp

    options = {
        "minutes": minutes, "every_s": every_s, "frames": frames, "limit_percent": limit_percent,
        "within_minutes": within_minutes, "window_mm": window_mm, "tile_mm": tile_mm,
        "theta_i_deg": theta_i_deg, "theta_r_deg": theta_r_deg,
    }  # fmt: skip
    calibrate_lamp(rig, out, options, plan_only=plan, as_json=json)


@calibrate.command()
def board(
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File for the page, new, .pdf.")
    ] = None,
    columns: Columns = 6,
    rows: Rows = 6,
    square_mm: Annotated[float, typer.Option(help="Side of a square.")] = 8.0,
) -> None:
    """Draw the board for `gonio calibrate geometry`, at its true size on a page of A4.

    Squares and markers (ChArUco, DICT_4X4_50 of OpenCV), a ruler to check the print, and what to
    do. The board of 50 mm fits where a sample of that size does.
    """
    from acquisition.commands.calibrate import draw_board
    from instrument.board import Board

    draw_board(out, Board(columns=columns, rows=rows, square_mm=square_mm))


@calibrate.command()
def geometry(
    rig: RigOnly = None,
    out: CalibrationFile = None,
    plan: PlanOnly = False,
    columns: Columns = 6,
    rows: Rows = 6,
    square_mm: SquareMm = 8.0,
    u_square_mm: Annotated[float, typer.Option(help="Its standard uncertainty.")] = 0.02,
    poses: Annotated[int, typer.Option(help="Number of view angles.")] = 13,
    widest_deg: Annotated[
        float, typer.Option(help="The largest view angle, to both sides.")
    ] = 60.0,
    frames: Annotated[int, typer.Option(help="Frames at each view angle.")] = 4,
    theta_i_deg: Annotated[float, typer.Option(help="Where the lamp stands.")] = 30.0,
    dphi_deg: Annotated[float, typer.Option(help="Its azimuth from the camera's plane.")] = 0.0,
    yes: Annotated[bool, typer.Option("--yes", help="Move a real rig without asking.")] = False,
    json: Json = False,
) -> None:
    """Calibrate the geometry: scale, axis in the picture, roll, zero of theta_r, leans, height.

    The camera looks at the board of `gonio calibrate board` from many angles, then once more after
    the operator has turned it by half a turn: so the zero of theta_r is told from a lean of the
    board. Homes and moves the axes, within their limits and clear of keep-out zones. Exits with 5
    if the board is not found, is another one, or is saturated.
    """
    from acquisition.commands.calibrate import calibrate_geometry
    from instrument.board import Board

    options = {
        "board": Board(columns=columns, rows=rows, square_mm=square_mm),
        "u_square_mm": u_square_mm, "poses": poses, "widest_deg": widest_deg, "frames": frames,
        "theta_i_deg": theta_i_deg, "dphi_deg": dphi_deg,
    }  # fmt: skip
    calibrate_geometry(rig, out, options, plan_only=plan, yes=yes, as_json=json)
