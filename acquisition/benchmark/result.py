"""All that one run of `gonio bench` found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from acquisition.benchmark.study import Study


class MapPicture(Protocol):
    """A map of where methods fail: a picture and the numbers behind it, column by column."""

    @property
    def title(self) -> str:
        """What it shows."""

    @property
    def caption(self) -> str:
        """What to read off it."""

    @property
    def svg(self) -> str:
        """The picture."""

    @property
    def columns(self) -> Mapping[str, list[float | str]]:
        """The numbers, name -> values of one length."""


@dataclass(frozen=True, slots=True)
class Bench:
    """Studies, the machine and effort they were made with, and which peers took part."""

    effort: str
    seconds: float
    machine: Mapping[str, str]
    peers: tuple[str, ...]
    studies: tuple[Study, ...]
    maps: tuple[MapPicture, ...] = ()


@dataclass(frozen=True, slots=True)
class BenchFiles:
    """The files that a bench left."""

    folder: Path
    page: Path
    json: Path
    main_chart: Path
