"""Starting values of a fit: the local minima of chi2 on a grid, with the scales solved for.

The grid covers the parameters that are not scales, at each one's `starts` and at values between
them. At a node the BRDF is a constant plus terms that are proportional to the scales; linear least
squares with bounds gives the scales. Each term of a sum is evaluated on the grid of its own
parameters only, and chi2 of a node follows from the inner products of these parts: a new
covariance, or a node more, costs no new evaluation of a model.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from analysis.data.covariance import Covariance
from analysis.fit.search.problem import Problem
from analysis.models import Model, Parameter
from instrument.geometry import BoolArray, FloatArray, IntArray

# Least starting value of a scale, as a fraction of its domain: at zero others have no effect.
_OFF_ZERO = 1e-3
# Steps of the grid from one of a parameter's `starts` to the next, where a term has one such
# parameter, and where it has more: a narrow lobe fits few points in a narrow range of widths.
_STEPS_ONE, _STEPS_MORE = 4, 2
# Starts of a parameter from which on there are no values between them.
_ENOUGH_STARTS = 10
# Points from which on chi2 has hardly more minima than a coarser grid shows.
MANY = 90
# Nodes of the whole grid beyond which there are no values between the `starts`.
_MOST_NODES = 8000

# Local minima of a grid that are looked at; squared distance of two curves, relative to their chi2,
# below which they count as one.
_MOST_MINIMA, _SAME_CURVE = 100, 1e-6

Known = dict[tuple[object, ...], list[FloatArray]]
"""Parts of terms (N,), each at scale 0 and per unit of each scale, by the term and its node."""

Parameters = tuple[Parameter, ...]


@dataclass(frozen=True, slots=True)
class _Layout:
    """M nodes of a grid, for any data, with indices into columns that the nodes share.

    x: parameters (M, K), in their own units. shape: number of values of each searched parameter.
    solved: indices of the parameters solved for at each node. own: for each term the parameters of
    its own nodes. constants: (M, T), the part of each term without scales; column 0 is zero.
    per_scale: (M, S, T), the increase of each term per unit of each parameter solved for.
    """

    x: FloatArray
    shape: tuple[int, ...]
    solved: tuple[int, ...]
    own: tuple[tuple[dict[str, float], ...], ...]
    constants: IntArray
    per_scale: IntArray


@lru_cache(maxsize=128)
def _layout(parameters: Parameters, terms: tuple[Parameters, ...], many: bool) -> _Layout:
    """Layout for a model with these parameters; with many points some axes have fewer values."""
    values = _searched_values(parameters, terms, many)
    solved = [i for i, p in enumerate(parameters) if p.scale or p.level]
    nodes = list(itertools.product(*values))
    at = dict(zip((p.name for p in parameters), np.reshape(nodes, (len(nodes), -1)).T, strict=True))
    constants = np.zeros((len(nodes), len(terms)), dtype=np.int64)
    per_scale = np.zeros((len(nodes), len(solved), len(terms)), dtype=np.int64)
    own, first = [], 1
    for t, term in enumerate(terms):
        names = [p.name for p in term]
        own_nodes, index = np.unique(
            np.stack([at[name] for name in names], axis=1), axis=0, return_inverse=True
        )
        own.append(tuple(dict(zip(names, map(float, node), strict=True)) for node in own_nodes))
        mine = [k for k, i in enumerate(solved) if parameters[i].name in names]
        width = 1 + len(mine)
        constants[:, t] = first + width * index.ravel()
        for n, k in enumerate(mine):
            per_scale[:, k, t] = constants[:, t] + 1 + n
        first += width * len(own_nodes)
    x = np.reshape(nodes, (len(nodes), len(parameters)))
    return _Layout(x, tuple(map(len, values)), tuple(solved), tuple(own), constants, per_scale)


@dataclass(frozen=True, slots=True)
class Grid:
    """A model on the nodes of its grid: `columns` (P, N) in 1/sr hold the parts of its terms."""

    problem: Problem
    layout: _Layout
    columns: FloatArray

    @classmethod
    def of(cls, problem: Problem, known: Known | None = None) -> Grid:
        """Evaluate the model of a problem on its grid; `known` parts are taken, and added to."""
        terms = problem.model.terms or (problem.model,)
        many = problem.brdf.size >= MANY
        layout = _layout(problem.model.parameters, tuple(t.parameters for t in terms), many)
        known = {} if known is None else known
        columns = [np.zeros(problem.brdf.size)]
        for term, nodes in zip(terms, layout.own, strict=True):
            columns += _linear_parts(problem, term, nodes, known)
        return cls(problem, layout, np.stack(columns))

    def minima(self, covariance: Covariance, count: int) -> list[FloatArray]:
        """At most `count` starts x (K,): local minima of chi2 on the grid, best first.

        Of more minima, those whose curves differ most are taken: along a valley many are alike.
        """
        layout, parameters = self.layout, self.problem.model.parameters
        solved = list(layout.solved)
        high = self.problem.high[solved]
        white = _Whitened.of(self, covariance)
        found, chi2 = white.scales(
            np.array([np.inf if parameters[i].level else parameters[i].high for i in solved])
        )
        minima = np.flatnonzero(_local_minima(chi2.reshape(layout.shape)))
        minima = minima[np.argsort(chi2[minima], kind="stable")][:_MOST_MINIMA]
        curves = np.stack([white.curve(int(node), found[node]) for node in minima])
        chosen = minima[_different(curves, chi2[minima], count)]
        x = layout.x[chosen]
        most = np.array([_highest_start(parameters[i]) for i in solved])
        x[:, solved] = np.clip(found[chosen], _OFF_ZERO * high, most)
        return list(x)


def _highest_start(parameter: Parameter) -> float:
    """Highest starting value of a parameter that is solved for: its upper bound, but for a level.

    At the upper bound of a level, the albedo 1, its derivative is infinite: a search that starts
    there moves the other parameters in its place, and may end in the wrong minimum.
    """
    return max(parameter.starts) if parameter.level else parameter.high


@dataclass(frozen=True, slots=True)
class _Whitened:
    """A grid in units of u: columns V (N, P), data (N,), and their inner products."""

    grid: Grid
    V: FloatArray
    data: FloatArray
    Q: FloatArray

    @classmethod
    def of(cls, grid: Grid, covariance: Covariance) -> _Whitened:
        V = covariance.whiten(grid.columns.T)
        return cls(grid, V, covariance.whiten(grid.problem.brdf), V.T @ V)

    def scales(self, high: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Scales (M, S) of least chi2 at every node, and chi2 (M,)."""
        Q, h, total = self.Q, self.data @ self.V, float(self.data @ self.data)
        c, s = self.grid.layout.constants, self.grid.layout.per_scale
        squares, g = np.full(len(c), total), h[s].sum(2)
        if c.any():
            squares -= 2 * h[c].sum(1)
            squares += Q[c[:, :, np.newaxis], c[:, np.newaxis, :]].sum((1, 2))
            g -= Q[s[:, :, :, np.newaxis], c[:, np.newaxis, np.newaxis, :]].sum((2, 3))
        left, right = s[:, :, np.newaxis, :, np.newaxis], s[:, np.newaxis, :, np.newaxis, :]
        return _bounded_normal_equations(Q[left, right].sum((3, 4)), g, squares, high)

    def curve(self, node: int, scales: FloatArray) -> FloatArray:
        """Model (N,) at a node with these scales (S,), in units of u."""
        layout = self.grid.layout
        per_scale = self.V[:, layout.per_scale[node]].sum(axis=2)
        return np.asarray(self.V[:, layout.constants[node]].sum(axis=1) + per_scale @ scales)


def _different(curves: FloatArray, chi2: FloatArray, count: int) -> IntArray:
    """Indices of at most `count` of the curves (M, N), in units of u: those that differ most.

    The first one, of least chi2, is the first; each further one is the one furthest from those
    before it, in relation to its own chi2. Curves that are the same count once.
    """
    chosen = [0]
    nearest = np.full(len(curves), np.inf)
    while len(chosen) < count:
        distance = np.sum(np.square(curves - curves[chosen[-1]]), axis=1)
        nearest = np.minimum(nearest, distance)
        with np.errstate(over="ignore"):  # inf: far more than its chi2
            different = nearest / np.maximum(chi2, 1e-300)
        if np.max(different) < _SAME_CURVE:
            break
        chosen.append(int(np.argmax(different)))
    return np.sort(chosen)


def starting_values(problem: Problem, count: int) -> list[FloatArray]:
    """At most `count` parameter vectors (K,): the local minima of chi2 on the grid, best first.

    In the parameters' own units.
    """
    return Grid.of(problem).minima(problem.covariance, count)


def _searched_values(
    parameters: Parameters, terms: tuple[Parameters, ...], many: bool
) -> list[tuple[float, ...]]:
    """Values on the grid of each parameter; of a scale its default alone."""
    fine = [values_between(p, _steps(p, terms, many)) for p in parameters]
    if np.prod([len(values) for values in fine]) <= _MOST_NODES:
        return fine
    return [values_between(p, 1) for p in parameters]


def _steps(parameter: Parameter, terms: tuple[Parameters, ...], many: bool) -> int:
    """Steps between two `starts`: fewer where a term has several parameters to search for."""
    if parameter.level or len(parameter.starts) > _ENOUGH_STARTS:
        return 1
    shapes = [[p.name for p in term if not p.scale and len(p.starts) > 1] for term in terms]
    if max((len(names) for names in shapes if parameter.name in names), default=1) == 1:
        return _STEPS_ONE
    return 1 if many and parameter.logarithmic else _STEPS_MORE


def values_between(parameter: Parameter, steps: int) -> tuple[float, ...]:
    """The `starts` and values between them, geometrically in the distance from the lower bound."""
    if parameter.scale:
        return (parameter.default,)
    above = np.maximum(np.array(parameter.starts) - parameter.low, 1e-12)
    at = np.arange((above.size - 1) * steps + 1) / steps
    fine = parameter.low + np.exp(np.interp(at, np.arange(above.size), np.log(above)))
    fine[::steps] = parameter.starts
    return tuple(float(value) for value in np.minimum(fine, parameter.high))


def _linear_parts(
    problem: Problem, term: Model, nodes: tuple[dict[str, float], ...], known: Known
) -> list[FloatArray]:
    """For each node the term with all scales at 0, and its increase per unit of each; (N,) each.

    A term that is 0 at the first node without its scales is 0 there at all of them. A level counts
    as a scale from 0 to its value at the node.
    """
    parts: list[FloatArray] = []
    solved = [p for p in term.parameters if p.scale or p.level]
    zeros = {p.name: 0.0 for p in solved}
    constant: FloatArray | None = None
    for values in nodes:
        key = term.name, *values.items()
        if key not in known:
            if constant is None or np.any(constant):
                constant = np.asarray(term.kernel(problem.geometry, **{**values, **zeros}))
            known[key] = [constant]
            for p in solved:
                brdf = term.kernel(problem.geometry, **{**values, **zeros, p.name: values[p.name]})
                known[key].append((brdf - constant) / values[p.name])
        constant = known[key][0]
        parts += known[key]
    return parts


def bounded_least_squares(
    A: FloatArray, b: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Solve M problems: x (M, S) of least |A x - b|^2 with 0 <= x, clipped at `high` (S,).

    A is (M, N, S), b (M, N), both in units of u; returns x, in the units of `high`, and the
    remaining sums of squares (M,). All subsets of nonzero x are tried: there are few. After
    clipping the others are not solved for again, which is good enough for a start.
    """
    G, g = np.swapaxes(A, 1, 2) @ A, (np.swapaxes(A, 1, 2) @ b[..., np.newaxis])[..., 0]
    return _bounded_normal_equations(G, g, np.sum(b * b, axis=1), high)


def _bounded_normal_equations(
    G: FloatArray, g: FloatArray, total: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """`bounded_least_squares` of G = A^T A (M, S, S), g = A^T b (M, S) and total = |b|^2 (M,)."""
    scale = np.sqrt(np.maximum(np.diagonal(G, axis1=1, axis2=2), 1e-300))
    G, g = G / (scale[:, :, np.newaxis] * scale[:, np.newaxis, :]), g / scale
    best, least = np.zeros_like(g), total.copy()
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
    """Mask of the nodes of a grid with no smaller neighbour along any axis.

    Along a valley oblique to the axes there are several: its ends may lead to different minima.
    """
    low = np.ones(chi2.shape, dtype=bool)
    for axis in range(chi2.ndim):
        along, lower = np.swapaxes(chi2, 0, axis), np.swapaxes(low, 0, axis)  # views
        lower[:-1] &= along[:-1] <= along[1:]
        lower[1:] &= along[1:] <= along[:-1]
    return low
