"""Result of one run of `gonio bench`: studies, maps, and the machine they were made on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from acquisition.benchmark.study import Study


@dataclass(frozen=True, slots=True)
class MapPicture:
    """Map of where methods fail: title, caption, picture (SVG), and its numbers by column."""

    title: str
    caption: str
    svg: str
    columns: Mapping[str, list[float | str]]


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchmarkResult:
    """Studies and maps, with effort, duration, machine and the state of the other programs."""

    effort: str
    seconds: float
    machine: Mapping[str, str]
    peers: tuple[str, ...]
    studies: tuple[Study, ...]
    maps: tuple[MapPicture, ...] = ()
