"""Where to begin a search: the best nodes of a coarse grid, with the scales solved for.

The grid runs over the parameters that are no scales, at each one's `starts`; at its nodes the BRDF
is taken as a constant and a sum of terms, each proportional to a scale, and the scales come from
linear least squares with their bounds. A term of a sum is evaluated on the grid of its own
parameters only.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.fit.problem import Problem
from analysis.models import Model, Parameter
from instrument.geometry import BoolArray, FloatArray

# A start lies off zero by this part of a scale's domain: at zero other parameters have no effect.
_OFF_ZERO = 1e-3


class _Grid(NamedTuple):
    """The model on the nodes: parameters (M, K), constant part (M, N), terms per scale (M, N, S).

    All whitened.
    """

    x: FloatArray
    constant: FloatArray
    terms: FloatArray


def starts(problem: Problem, most: int) -> list[FloatArray]:
    """Up to `most` parameter vectors: the grid's local minima of chi2, the deepest first."""
    shape = tuple(len(p.starts) for p in problem.model.parameters if not p.scale)
    scales = [i for i, p in enumerate(problem.model.parameters) if p.scale]
    grid = _grid(problem)
    wanted = problem.covariance.whiten(problem.brdf - problem.offset) - grid.constant
    found, chi2 = bounded_least_squares(grid.terms, wanted, problem.high[scales])
    grid.x[:, scales] = np.maximum(found, _OFF_ZERO * problem.high[scales])
    minima = np.flatnonzero(_local_minima(chi2.reshape(shape)))
    deepest = minima[np.argsort(chi2[minima])][:most]
    return [grid.x[node] for node in deepest]


def _grid(problem: Problem) -> _Grid:
    parameters = problem.model.parameters
    searched = [i for i, p in enumerate(parameters) if not p.scale]
    scales = [p.name for p in parameters if p.scale]
    nodes = list(itertools.product(*(parameters[i].starts for i in searched)))
    x = np.tile([p.default for p in parameters], (len(nodes), 1))
    x[:, searched] = np.reshape(nodes, (len(nodes), len(searched)))
    constant = np.zeros((len(nodes), problem.brdf.size))
    terms = np.zeros((*constant.shape, len(scales)))
    names = [parameters[i].name for i in searched]
    for model in problem.model.terms or (problem.model,):
        own, mine, place = _own_grid(problem, model, names, nodes)
        constant += own[place]
        for name, values in mine.items():
            terms[:, :, scales.index(name)] += values[place]
    return _Grid(x, constant, terms)


def _own_grid(
    problem: Problem, model: Model, names: list[str], nodes: list[tuple[float, ...]]
) -> tuple[FloatArray, dict[str, FloatArray], NDArray[np.intp]]:
    """A term's constant part and its part per scale on the nodes of its own parameters, whitened.

    (m, N) each, and which of the m each node of the whole grid (M,) has.
    """
    mine = [k for k, name in enumerate(names) if any(p.name == name for p in model.parameters)]
    own = [tuple(node[k] for k in mine) for node in nodes]
    each = {node: n for n, node in enumerate(dict.fromkeys(own))}
    at = [dict(zip([names[k] for k in mine], node, strict=True)) for node in each]
    scales = [p for p in model.parameters if p.scale]
    parts = [_parts(problem, model, values, scales) for values in at]
    constant = np.stack([part[0] for part in parts])
    per_scale = {p.name: np.stack([part[1][p.name] for part in parts]) for p in scales}
    return constant, per_scale, np.array([each[node] for node in own])


def _parts(
    problem: Problem, model: Model, values: dict[str, float], scales: list[Parameter]
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """What a model is with all scales at 0, and what each adds to it per unit; whitened, (N,)."""

    def whitened(**at: float) -> FloatArray:
        return problem.covariance.whiten(
            problem.gain * model.kernel(problem.geometry, **values, **at)
        )

    none = {p.name: 0.0 for p in scales}
    constant = whitened(**none)
    per_scale = {
        p.name: (whitened(**{**none, p.name: p.default}) - constant) / p.default for p in scales
    }
    return constant, per_scale


def bounded_least_squares(
    A: FloatArray, b: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """x (M, S) of least |A x - b|^2 with 0 <= x, cut at `high` (S,), and what is left (M,).

    A is (M, N, S), b (M, N). Every set of x that are not 0 is tried: there are few. Cut at `high`,
    the others are not solved for again: good enough to begin with.
    """
    G, g = np.swapaxes(A, 1, 2) @ A, (np.swapaxes(A, 1, 2) @ b[..., np.newaxis])[..., 0]
    scale = np.sqrt(np.maximum(np.diagonal(G, axis1=1, axis2=2), 1e-300))
    G, g = G / (scale[:, :, np.newaxis] * scale[:, np.newaxis, :]), g / scale
    best, least = np.zeros_like(g), np.sum(b * b, axis=1)
    nothing = least.copy()
    for chosen in itertools.product((False, True), repeat=g.shape[1]):
        if not any(chosen):
            continue
        x = np.zeros_like(g)
        x[:, chosen] = _solved(G[:, chosen][:, :, chosen], g[:, chosen])
        sound = np.all(x >= 0, axis=1)
        x = np.minimum(x, high * scale)
        left = nothing - 2 * np.sum(x * g, axis=1) + np.einsum("mi,mij,mj->m", x, G, x)
        better = sound & (left < least)
        best[better], least[better] = x[better], left[better]
    return best / scale, least


def _solved(G: FloatArray, g: FloatArray) -> FloatArray:
    """G^-1 g of stacks; terms that are alike to rounding share what they explain."""
    ridge = 1e-12 * np.eye(g.shape[1])
    return np.asarray(np.linalg.solve(G + ridge, g[..., np.newaxis])[..., 0])


def _local_minima(depth: FloatArray) -> BoolArray:
    """Where a grid's value is not above any neighbour's along the axes."""
    low = np.ones(depth.shape, dtype=bool)
    for axis in range(depth.ndim):
        rise = np.diff(depth, axis=axis)
        edge = [(0, 0)] * depth.ndim
        edge[axis] = (0, 1)
        low &= np.pad(rise >= 0, edge, constant_values=True)
        edge[axis] = (1, 0)
        low &= np.pad(rise <= 0, edge, constant_values=True)
    return low
