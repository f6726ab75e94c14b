"""Cubic spline through values on a rectangular grid, in NumPy alone.

`scipy.interpolate` does the same, but importing it would cost every run a fifth of a second.

Source: C. de Boor, "A Practical Guide to Splines" (1978), chapters IX (not-a-knot), X and XVII.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from instrument.geometry import FloatArray, IntArray

_BLOCK = 1024  # points at a time: their weights fit into the cache


@dataclass(frozen=True, slots=True)
class GridSpline:
    """Tensor product of not-a-knot cubic splines over D axes, for M values at once.

    knots: those of each axis. coefficients: shape (nodes of each axis, M).
    """

    knots: tuple[FloatArray, ...]
    coefficients: FloatArray

    @classmethod
    def through(cls, axes: Sequence[FloatArray], values: FloatArray) -> GridSpline:
        """Return the spline through values of shape (nodes of each axis, M), in any unit."""
        knots = tuple(np.concatenate([[x[0]] * 4, x[2:-2], [x[-1]] * 4]) for x in axes)
        for axis, (t, nodes) in enumerate(zip(knots, axes, strict=True)):
            first, basis = _basis(t, nodes)
            at_nodes = np.zeros((nodes.size, nodes.size))
            for k, weight in enumerate(basis):
                at_nodes[np.arange(nodes.size), first + k] = weight
            moved = np.moveaxis(values, axis, 0)
            solved = np.linalg.solve(at_nodes, moved.reshape(nodes.size, -1))
            values = np.moveaxis(np.asarray(solved, np.float64).reshape(moved.shape), 0, axis)
        return cls(knots, np.ascontiguousarray(values))

    def at_first(self, x: float) -> GridSpline:
        """Return the spline over the other axes at `x` of the first; NaN outside, as in `at`."""
        first, basis = _basis(self.knots[0], np.array([x]))
        rows = self.coefficients[first[0] : first[0] + 4]
        return GridSpline(self.knots[1:], np.tensordot(basis[:, 0], rows, axes=1))

    def at(self, *x: FloatArray) -> FloatArray:
        """Return the values (M, N), in their unit, at N points given by axis; NaN outside."""
        shape = self.coefficients.shape[:-1]
        columns = np.ascontiguousarray(self.coefficients.reshape(-1, self.coefficients.shape[-1]).T)
        corners = np.indices((4,) * len(x)).reshape(len(x), -1, 1)
        offsets = np.asarray(np.ravel_multi_index(tuple(corners), shape))
        found = np.empty((columns.shape[0], x[0].size))
        for start in range(0, x[0].size, _BLOCK):
            part = slice(start, start + _BLOCK)
            firsts, bases = zip(*map(_basis, self.knots, (along[part] for along in x)), strict=True)
            weights = bases[0]
            for basis in bases[1:]:
                weights = (weights[:, np.newaxis] * basis).reshape(-1, basis.shape[1])
            index = np.ravel_multi_index(firsts, shape) + offsets
            for m, column in enumerate(columns):
                found[m, part] = np.sum(weights * column[index], axis=0)
        return found


def _basis(t: FloatArray, x: FloatArray) -> tuple[IntArray, FloatArray]:
    """First index of the four B-splines that are not 0 at x (N,), and their values (4, N)."""
    interval = np.clip(np.searchsorted(t, x, side="right") - 1, 3, t.size - 5)
    around = t[interval + np.arange(-2, 4)[:, np.newaxis]]  # the knots next to x, three a side
    below, above = x - around[:3], around[3:] - x
    basis = np.where((x < t[0]) | (x > t[-1]), np.nan, 1.0)[np.newaxis]
    for degree in (1, 2, 3):
        low, high = below[3 - degree :], above[:degree]
        part = basis / (low + high)
        basis = np.zeros((degree + 1, x.size))
        basis[:-1] = high * part
        basis[1:] += low * part
    return interval - 3, basis
