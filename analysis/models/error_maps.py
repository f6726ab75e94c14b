"""Reader of the stored error maps: the largest error of each approximate method, cell by cell.

What to use when: `rough.form_bounds` and `acquisition.benchmark.maps.smooth_dielectric`, which look
errors up here; `acquisition.benchmark.maps.make_error_maps` to compute the file.

`error_maps.npz` holds errors as levels of one byte, rounded up:

=========  ===========================================  ========================================
map        cells over                                   of
=========  ===========================================  ========================================
rough      sigma, larger angle, smaller over larger,    Lambert, (36), (33)+(34), the table
           dphi (the grid of `form_error_table`)        `form_error_table`, and the coarse rule
smooth     n, sqrt(1 - rho), angle of one ray           Chandrasekhar's H of some orders: the
                                                        lamp's ray, and the camera's with its K
=========  ===========================================  ========================================

A cell's value is the largest error found in it, its corners included, and a margin for what lies
between: a share of how much the error changes there (a form), or half as much again as the
largest of the cell and its neighbours (rounding and quadrature, which are not smooth).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from instrument.geometry import FloatArray, IntArray

Levels = NDArray[np.uint8]

FILE = Path(__file__).with_name("error_maps.npz")


_LEAST, _PER_OCTAVE = 1e-8, 8  # logarithmic scale: level 0 is an error of _LEAST or less


def levels_of(errors: FloatArray) -> Levels:
    """Bytes of relative errors (any shape, a ratio), rounded up; 255 is without limit."""
    octaves = np.log2(np.maximum(errors, _LEAST) / _LEAST)
    return np.minimum(np.ceil(octaves * _PER_OCTAVE - 1e-9), 255).astype(np.uint8)


def errors_of(levels: Levels) -> FloatArray:
    """Relative errors of bytes (any shape, a ratio): never smaller than those stored."""
    found = _LEAST * np.exp2(levels / _PER_OCTAVE)
    return np.where(levels == 255, np.inf, found)


@cache
def maps() -> Mapping[str, Levels]:
    """The maps: `rough` (method, sigma, larger, ratio, dphi), `smooth_lamp`, `smooth_camera`
    (order, n, root, theta).
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
