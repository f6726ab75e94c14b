"""Command `gonio bench`: measure all studies, draw the maps, write page, tables and charts."""

from __future__ import annotations

import time
from pathlib import Path

from acquisition.benchmark.effort import QUICK, WHOLE, Effort
from acquisition.benchmark.machine import machine
from acquisition.benchmark.output.files import empty_folder, write
from acquisition.benchmark.peers import peer_lines
from acquisition.benchmark.result import BenchmarkResult, MapPicture
from acquisition.terminal.console import console, duration_text, out


def run_benchmark(folder: Path, quick: bool, with_maps: bool) -> None:
    """Measure all studies and write them into `folder`, which must be absent or empty.

    Raises `InputError` if it is neither.
    """
    empty_folder(folder)
    # SciPy is imported only after the folder has been checked.
    from acquisition.benchmark.studies.all_studies import studies

    effort, begun_s = QUICK if quick else WHOLE, time.monotonic()
    found = tuple(studies(effort, _tell))
    pictures = _maps(effort) if with_maps else ()
    lines, seconds = tuple(peer_lines().values()), time.monotonic() - begun_s
    result = BenchmarkResult(
        effort=effort.name, seconds=seconds, machine=machine(), peers=lines, studies=found,
        maps=pictures,
    )  # fmt: skip
    page = write(result, folder)
    out.print(
        f"{sum(len(s.trials) for s in found)} trials in {duration_text(seconds)}: {page}",
        highlight=False,
        soft_wrap=True,
    )


def _tell(words: str) -> None:
    console.print(words, highlight=False)


def _maps(effort: Effort) -> tuple[MapPicture, ...]:
    from acquisition.benchmark.corrections.picture import corrections_picture
    from acquisition.benchmark.maps.all_maps import draw_maps

    _tell("maps")
    maps = tuple(draw_maps())
    _tell("corrections on a bench with defects")
    return (*maps, corrections_picture(effort.seeds))
