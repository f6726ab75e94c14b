"""Starting values of a fit: the best nodes of a coarse grid, with the scales solved for.

The grid covers the parameters that are not scales, at each one's `starts`. At a node the BRDF is a
constant plus terms that are proportional to the scales; linear least squares with bounds gives the
scales. Each term of a sum is evaluated on the grid of its own parameters only.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from analysis.fit.problem import Problem
from analysis.models import Model, Parameter
from instrument.geometry import BoolArray, FloatArray, IntArray

# Least starting value of a scale, as a fraction of its domain: at zero others have no effect.
_OFF_ZERO = 1e-3


class _Grid(NamedTuple):
    """The whitened model on the nodes.

    x: parameters (M, K). constant: part without scales (M, N). terms: parts per scale (M, N, S).
    """

    x: FloatArray
    constant: FloatArray
    terms: FloatArray


def starting_values(problem: Problem, count: int) -> list[FloatArray]:
    """At most `count` parameter vectors (K,): the local minima of chi2 on the grid, best first.

    In the parameters' own units.
    """
    shape = tuple(len(p.starts) for p in problem.model.parameters if not p.scale)
    scales = [i for i, p in enumerate(problem.model.parameters) if p.scale]
    grid = _grid(problem)
    wanted = problem.covariance.whiten(problem.brdf - problem.offset) - grid.constant
    found, chi2 = bounded_least_squares(grid.terms, wanted, problem.high[scales])
    grid.x[:, scales] = np.maximum(found, _OFF_ZERO * problem.high[scales])
    minima = np.flatnonzero(_local_minima(chi2.reshape(shape)))
    deepest = minima[np.argsort(chi2[minima])][:count]
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
        own, per_scale, index = _on_own_grid(problem, model, names, nodes)
        constant += own[index]
        for name, values in per_scale.items():
            terms[:, :, scales.index(name)] += values[index]
    return _Grid(x, constant, terms)


def _on_own_grid(
    problem: Problem, model: Model, names: list[str], nodes: list[tuple[float, ...]]
) -> tuple[FloatArray, dict[str, FloatArray], IntArray]:
    """Whitened constant part, and part per scale, of a term on the grid of its own parameters.

    (m, N) each; and for every node of the whole grid (M,) the index of its node in the own grid.
    """
    mine = [k for k, name in enumerate(names) if any(p.name == name for p in model.parameters)]
    own = [tuple(node[k] for k in mine) for node in nodes]
    index = {node: n for n, node in enumerate(dict.fromkeys(own))}
    at = [dict(zip([names[k] for k in mine], node, strict=True)) for node in index]
    scales = [p for p in model.parameters if p.scale]
    parts = [_linear_parts(problem, model, values, scales) for values in at]
    constant = np.stack([part[0] for part in parts])
    per_scale = {p.name: np.stack([part[1][p.name] for part in parts]) for p in scales}
    return constant, per_scale, np.array([index[node] for node in own], dtype=np.int64)


def _linear_parts(
    problem: Problem, model: Model, values: dict[str, float], scales: list[Parameter]
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Whitened model with all scales at 0, and the increase per unit of each scale; (N,) each."""

    def whitened(**at: float) -> FloatArray:
        return problem.covariance.whiten(
            problem.gain * model.kernel(problem.geometry, **values, **at)
        )

    zeros = {p.name: 0.0 for p in scales}
    constant = whitened(**zeros)
    per_scale = {
        p.name: (whitened(**{**zeros, p.name: p.default}) - constant) / p.default for p in scales
    }
    return constant, per_scale


def bounded_least_squares(
    A: FloatArray, b: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Solve M problems: x (M, S) of least |A x - b|^2 with 0 <= x, clipped at `high` (S,).

    A is (M, N, S), b (M, N), both in units of u; returns x, in the units of `high`, and the
    remaining sums of squares (M,). All subsets of nonzero x are tried: there are few. After
    clipping the others are not solved for again, which is good enough for a start.
    """
    G, g = np.swapaxes(A, 1, 2) @ A, (np.swapaxes(A, 1, 2) @ b[..., np.newaxis])[..., 0]
    scale = np.sqrt(np.maximum(np.diagonal(G, axis1=1, axis2=2), 1e-300))
    G, g = G / (scale[:, :, np.newaxis] * scale[:, np.newaxis, :]), g / scale
    best, least = np.zeros_like(g), np.sum(b * b, axis=1)
    total = least.copy()
    for chosen in itertools.product((False, True), repeat=g.shape[1]):
        if not any(chosen):
            continue
        x = np.zeros_like(g)
        x[:, chosen] = _solve_stack(G[:, chosen][:, :, chosen], g[:, chosen])
        allowed = np.all(x >= 0, axis=1)
        x = np.minimum(x, high * scale)
        left = total - 2 * np.sum(x * g, axis=1) + np.einsum("mi,mij,mj->m", x, G, x)
        better = allowed & (left < least)
        best[better], least[better] = x[better], left[better]
    return best / scale, least


def _solve_stack(G: FloatArray, g: FloatArray) -> FloatArray:
    """G^-1 g of stacked systems; terms that agree to rounding share what they explain."""
    ridge = 1e-12 * np.eye(g.shape[1])
    return np.asarray(np.linalg.solve(G + ridge, g[..., np.newaxis])[..., 0])


def _local_minima(chi2: FloatArray) -> BoolArray:
    """Mask of the nodes of a grid with no smaller neighbour along any axis."""
    low = np.ones(chi2.shape, dtype=bool)
    for axis in range(chi2.ndim):
        rise = np.diff(chi2, axis=axis)
        edge = [(0, 0)] * chi2.ndim
        edge[axis] = (0, 1)
        low &= np.pad(rise >= 0, edge, constant_values=True)
        edge[axis] = (1, 0)
        low &= np.pad(rise <= 0, edge, constant_values=True)
    return low
