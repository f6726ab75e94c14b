"""Reader of the stored error maps: the largest error of each approximate method, cell by cell.

What to use when: `rough.form_bounds` and the bounds in `analysis.accuracy`, which look errors up
here; `acquisition.benchmark.maps.make_error_maps` to compute the file.

`error_maps.npz` holds errors as levels of one byte, rounded up:

=========  ===========================================  ========================================
map        cells over                                   of
=========  ===========================================  ========================================
rough      sigma, larger angle, smaller over larger,    Lambert, (36), (33)+(34), the table
           dphi (the grid of `form_error_table`)        `form_error_table`, and the coarse rule
smooth     n, sqrt(1 - rho), angle of one ray           Chandrasekhar's H of some orders: the
                                                        lamp's ray, and the camera's with its K
lobe       ln g, ln q of `beckmann_spizzichino`         the sum's limits g << 1 and g >> 1, its
                                                        first 10 and 100 terms; relative, and
                                                        absolute for wings too faint to measure
=========  ===========================================  ========================================

A cell's value is the largest error found in it, its corners included, and a margin for what lies
between: a share of how much the error changes there (a form), or half as much again as the
largest of the cell and its neighbours (rounding and quadrature, which are not smooth).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from instrument.geometry import FloatArray, IntArray

Levels = NDArray[np.uint8]

FILE = Path(__file__).with_name("error_maps.npz")


class Scale(NamedTuple):
    """Logarithmic scale of errors in a byte: 0 is `least` or less, then `per_octave` levels."""

    least: float
    per_octave: int

    def levels(self, errors: FloatArray) -> Levels:
        """Bytes of errors (any shape, a ratio), rounded up; 255 is without limit."""
        octaves = np.log2(np.maximum(errors, self.least) / self.least)
        return np.minimum(np.ceil(octaves * self.per_octave - 1e-9), 255).astype(np.uint8)

    def errors(self, levels: Levels) -> FloatArray:
        """Errors of bytes (any shape, a ratio): never smaller than those stored."""
        found = self.least * np.exp2(levels / self.per_octave)
        return np.where(levels == 255, np.inf, found)


RELATIVE = Scale(1e-8, 8)
ABSOLUTE = Scale(1e-22, 3)


@cache
def maps() -> Mapping[str, Levels]:
    """The maps: `rough` (method, sigma, larger, ratio, dphi), `smooth_lamp`, `smooth_camera`
    (order, n, root, theta), `lobe`, `lobe_absolute` (method, ln g, ln q).
    """
    with np.load(FILE) as file:
        found: dict[str, Levels] = {name: file[name] for name in file.files}
    for levels in found.values():
        levels.setflags(write=False)  # shared by all callers
    return found


def cells_of(edges: FloatArray, low: float, high: float) -> slice:
    """Indices of the cells that a range from low to high touches, in the unit of the edges.

    `edges` (M,) rise.
    """
    first = int(np.searchsorted(edges, low, side="left")) - 1
    last = int(np.searchsorted(edges, high, side="right")) - 1
    first, last = (min(max(cell, 0), edges.size - 2) for cell in (first, last))
    return slice(min(first, last), max(first, last) + 1)


def cell_at(edges: FloatArray, value: FloatArray) -> IntArray:
    """Index of the cell between `edges` (M,), rising, that holds each value (any shape).

    Both have one unit. Values beyond the edges belong to the outer cells.
    """
    return np.clip(np.searchsorted(edges, value, side="right") - 1, 0, edges.size - 2)
