"""Figure of a paper: its panels, which are not drawn yet, and the numbers that it is checked by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

from analysis.report.style import NARROW_IN, Draw, Drawing, short_number


class Panel(NamedTuple):
    """Panel of a figure: a title in HTML, and a chart that is not drawn yet.

    `picture`: shows brightness, which a dark page must not invert.
    """

    title: str
    height_in: float
    draw: Draw
    picture: bool = False

    @property
    def drawing(self) -> Drawing:
        """The chart at the one width that fits half a page and a phone."""
        return Drawing(self.height_in, self.draw, NARROW_IN)


class Check(NamedTuple):
    """Statement of a paper, what the models give for it, and whether that agrees.

    `said` tells the statement in words of this project, with its place. `found` are the numbers.
    `remark`: why it does not hold, or holds only so far.
    """

    said: str
    found: str
    holds: bool
    remark: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperFigure:
    """Figure of a paper: number, title and caption in HTML, panels and checks."""

    number: str
    title: str
    caption: str
    panels: tuple[Panel, ...]
    checks: tuple[Check, ...]

    def renumbered(self, number: str, caption: str) -> PaperFigure:
        """Return the same figure as it stands in another paper, with that paper's equations."""
        return replace(self, number=number, caption=caption)


Maker = Callable[[], PaperFigure]


@dataclass(frozen=True, slots=True, kw_only=True)
class Paper:
    """Paper: `key` (year), citation, functions that make its figures, and what is left out, why."""

    key: str
    citation: str
    figures: tuple[Maker, ...]
    left_out: str


def close(said: str, stated: float, found: float, tolerance: float, unit: str = "") -> Check:
    """Check of a number that a paper states, to within `tolerance`, all in `unit`."""
    text = f"{short_number(found, 4)}{unit} (stated: {short_number(stated, 4)}{unit})"
    return Check(said, text, abs(found - stated) <= tolerance)
