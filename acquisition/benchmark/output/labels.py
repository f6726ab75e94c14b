"""Placement of a chart's labels such that they cover neither one another nor a mark."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

_GAP = 3.0  # points between a mark and its label
_NEAR = 12.0  # points: beyond it, a thin line leads from the label to its mark
_RINGS = (7.0, 13.0, 20.0, 28.0, 38.0, 50.0, 64.0)
_DIRECTIONS = (0, 180, 90, 270, 30, 150, 210, 330, 60, 120, 240, 300)


class Box(NamedTuple):
    """A rectangle in points."""

    left: float
    bottom: float
    right: float
    top: float

    def shared(self, other: Box) -> float:
        """Return the area of the intersection."""
        width = min(self.right, other.right) - max(self.left, other.left)
        height = min(self.top, other.top) - max(self.bottom, other.bottom)
        return max(width, 0.0) * max(height, 0.0)

    def outside(self, frame: Box) -> float:
        """Return the area outside a frame."""
        own = (self.right - self.left) * (self.top - self.bottom)
        return own - self.shared(frame)


class Placed(NamedTuple):
    """Box of a label; `far` if a line should lead to it."""

    box: Box
    far: bool


def place(
    marks: Sequence[tuple[float, float]],
    texts: Sequence[str],
    frame: Box,
    size: float,
    taken: Sequence[Box] = (),
) -> list[Placed]:
    """Place each text near its mark (points), the most crowded first; "" takes no room.

    Of all candidates the one that covers least is taken, and of those the nearest.
    """
    obstacles = [*taken, *(Box(x - 5, y - 5, x + 5, y + 5) for x, y in marks)]
    placed = [Placed(Box(*mark, *mark), False) for mark in marks]
    for n in sorted(range(len(marks)), key=lambda n: -_crowd(n, marks)):
        if texts[n]:
            placed[n] = _best(marks[n], text_size(texts[n], size), frame, obstacles)
            obstacles.append(placed[n].box)
    return placed


def _best(
    mark: tuple[float, float], size: tuple[float, float], frame: Box, obstacles: Sequence[Box]
) -> Placed:
    found: list[tuple[float, int, Placed]] = []
    for ring in _RINGS:
        for direction in _DIRECTIONS:
            box = _at(mark, size, ring, direction)
            covered = 4 * box.outside(frame) + sum(box.shared(other) for other in obstacles)
            found.append((covered, len(found), Placed(box, ring > _NEAR)))
        if min(found)[0] == 0:
            break
    return min(found)[2]


def _at(mark: tuple[float, float], size: tuple[float, float], ring: float, degrees: int) -> Box:
    """Box of a label in a direction from its mark, its nearest edge `ring` points away."""
    x = mark[0] + ring * math.cos(math.radians(degrees))
    y = mark[1] + ring * math.sin(math.radians(degrees))
    width, height = size
    left = x - width * (1 - math.cos(math.radians(degrees))) / 2
    bottom = y - height * (1 - math.sin(math.radians(degrees))) / 2
    return Box(left, bottom, left + width, bottom + height)


def _crowd(n: int, marks: Sequence[tuple[float, float]]) -> float:
    """Density of other marks around a mark."""
    return sum(1 / (1 + math.dist(marks[n], other)) for other in marks)


@lru_cache(maxsize=512)
def text_size(text: str, size: float) -> tuple[float, float]:
    """Return width and height of a line of text in points, with a small margin."""
    from matplotlib.textpath import TextPath

    width = TextPath((0, 0), text, size=size).get_extents().width
    return 1.06 * float(width) + _GAP, 1.25 * size
