"""What `gonio bench` does: measure, chart, write."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from pathlib import Path

from acquisition.benchmark.effort import QUICK, WHOLE
from acquisition.benchmark.machine import machine
from acquisition.benchmark.output.files import empty_folder, write
from acquisition.benchmark.peers import peers
from acquisition.benchmark.result import Bench, MapPicture
from acquisition.terminal.console import console, duration_text, out
from instrument.errors import InputError

MAPS = "acquisition.benchmark.maps.maps"


def run_bench(folder: Path, quick: bool, with_maps: bool) -> None:
    """Measure all studies and write them into `folder`, which must be absent or empty.

    Raises `InputError` where it is not, or where maps are asked for that this program has not.
    """
    draw_maps = _drawer() if with_maps else None
    empty_folder(folder)
    from acquisition.benchmark.studies.all_studies import (
        studies,  # what is asked wrongly needs no SciPy
    )

    effort, begun_s = QUICK if quick else WHOLE, time.monotonic()
    found = tuple(studies(effort, _tell))
    if draw_maps is not None:
        _tell("maps")
    pictures = () if draw_maps is None else tuple(draw_maps(folder))
    lines, seconds = tuple(peer.line for peer in peers()), time.monotonic() - begun_s
    left = write(Bench(effort.name, seconds, machine(), lines, found, pictures), folder)
    out.print(
        f"{sum(len(s.trials) for s in found)} trials in {duration_text(seconds)}: {left.page}",
        highlight=False,
        soft_wrap=True,
    )


def _tell(words: str) -> None:
    console.print(words, highlight=False)


def _drawer() -> Callable[[Path], list[MapPicture]]:
    """What draws the maps."""
    try:
        module = importlib.import_module(MAPS)
    except ModuleNotFoundError as error:
        if error.name != MAPS:
            raise
        raise InputError(f"--maps: {MAPS} is not installed: leave --maps out") from None
    drawer: Callable[[Path], list[MapPicture]] = module.draw_maps
    return drawer
