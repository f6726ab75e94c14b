"""Commands `gonio new ...`: arguments and help texts.

Each command imports its module when it is called, so that `gonio --help` loads nothing heavy.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from acquisition.cli_parts import Commands

new = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Write a commented rig file or protocol from a few questions.",
)

OutFile = Annotated[
    Path | None, typer.Option("--out", "-o", help="The new file, .yaml; never overwrites one.")
]
Given = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Answer to a question, which is then not asked; may be repeated.",
    ),
]
Defaults = Annotated[
    bool, typer.Option("--defaults", help="Ask nothing: take the default of each question.")
]


@new.command()
def rig(
    out: OutFile = None,
    given: Given = None,
    defaults: Defaults = False,
    identify: Annotated[
        bool,
        typer.Option("--identify", help="Query every serial port for known controllers first."),
    ] = False,
) -> None:
    """Write a rig file: cameras and serial ports found are offered, and a simulated rig.

    Nothing moves; cameras are only asked for their formats, sizes and controls. Calibrations of
    camera, lamp and geometry, if named, fill in what they found. Without a terminal the defaults
    are taken. --identify is that of `gonio devices`: do not use it while other machines are
    connected.
    """
    from acquisition.commands.new import new_rig

    new_rig(out, given or [], defaults=defaults, identify=identify)


@new.command()
def protocol(
    out: OutFile = None,
    rig: Annotated[Path | None, typer.Option("--rig", help="The rig file of the scan.")] = None,
    given: Given = None,
    defaults: Defaults = False,
) -> None:
    """Write a protocol for a rig file: sample, angles, measuring window, references.

    No device is opened. Each answer is checked by planning the scan. Without a terminal the
    defaults are taken.
    """
    from acquisition.commands.new import new_protocol

    new_protocol(out, rig, given or [], defaults=defaults)
