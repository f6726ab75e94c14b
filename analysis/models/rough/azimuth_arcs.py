"""Light of two bounces from arcs of azimuth where lamp or camera is hidden, by quadrature.

The symbols and the table of cases are those of `analysis.models.rough.single_slope`. The variable
is v = tan(phi / 2): cos(phi) = (1 - v^2) / (1 + v^2), dphi = 2 dv / (1 + v^2). Gauss-Legendre nodes
are clustered at the ends of an arc, since the square roots in the integrands have their branch
points just beyond; narrow arcs need few nodes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from instrument.geometry import FloatArray, IntArray

_CHUNK = 4096  # quadrature nodes at a time: their arrays stay in the processor's cache


class _Group(NamedTuple):
    """Arcs up to a width in v: share of the `nodes` that they need, clustered by tanh(k x)."""

    width: float
    share: float
    k: float


_GRAZING = 12.0  # tangent of the polar angle from which arcs need more nodes, as if wider

# Found by trial: for 10 `nodes` all groups have errors below 5e-7 of the radiance.
_ONCE_HIDDEN = (
    _Group(0.1, 0.3, 0.1),
    _Group(0.25, 0.5, 0.1),
    _Group(0.5, 0.6, 0.4),
    _Group(0.8, 0.7, 0.6),
    _Group(2.0, 1.3, 0.8),
    _Group(10.0, 2.0, 1.4),
    _Group(np.inf, 2.5, 2.5),
)
_TWICE_HIDDEN = (
    _Group(0.1, 0.5, 0.3),
    _Group(0.25, 0.7, 0.6),
    _Group(0.5, 0.8, 0.9),
    _Group(1.0, 1.4, 1.4),
    _Group(4.0, 2.0, 1.6),
    _Group(20.0, 2.0, 2.0),
    _Group(np.inf, 2.5, 2.5),
)


class OnceHiddenArcs(NamedTuple):
    """Arcs of azimuth where one direction is hidden, from 2 atan(low) to 2 atan(high).

    `tan` is that of the hidden direction, at azimuth 0; s|u| of the other is along * cos(phi) +
    across * sin(phi). `at`: index of the slope.
    """

    at: IntArray
    tan: FloatArray
    low: FloatArray
    high: FloatArray
    along: FloatArray
    across: FloatArray


class TwiceHiddenArcs(NamedTuple):
    """Arcs where both directions are hidden from opposite sides, from 2 atan(low) to 2 atan(high).

    x = p cos(phi), y = along * cos(phi) + across * sin(phi).
    """

    low: FloatArray
    high: FloatArray
    p: FloatArray
    along: FloatArray
    across: FloatArray
    cosine: FloatArray
    sine: FloatArray


def once_hidden(arcs: OnceHiddenArcs, size: int, nodes: int) -> FloatArray:
    """Integrals of (1 - s|u|) e / sin over the arcs, summed for each slope, (size,)."""
    each = (arcs.tan, arcs.low, arcs.high, arcs.along, arcs.across)
    width = (arcs.high - arcs.low) * np.maximum(1.0, arcs.tan / _GRAZING)
    values = _in_groups(_once_hidden_arc, each, width, _ONCE_HIDDEN, nodes)
    return np.asarray(np.bincount(arcs.at, values, size), dtype=np.float64)


def twice_hidden(arcs: TwiceHiddenArcs, equal: FloatArray, nodes: int) -> FloatArray:
    """Integrals of (1 + x) e_2 + (x y - 1) cos - W over the arcs (K,), dimensionless, (K,).

    `equal`: (K,), v = tan(phi / 2) where x = y. Steep facets have a sharp bend there, where their
    arcs are divided.
    """
    k = np.flatnonzero((arcs.sine > 0.8) & (equal > arcs.low) & (equal < arcs.high))
    arcs = TwiceHiddenArcs(*(np.concatenate([values, values[k]]) for values in arcs))
    arcs.high[k] = arcs.low[equal.size :] = equal[k]
    grazing = arcs.p * arcs.cosine / (arcs.sine * _GRAZING)
    width = (arcs.high - arcs.low) * np.where(arcs.sine > 0.94, 3.0, 1.0) * np.maximum(1.0, grazing)
    values = _in_groups(_twice_hidden_arc, arcs, width, _TWICE_HIDDEN, nodes)
    values[k] += values[equal.size :]
    return values[: equal.size]


def _in_groups(
    integral: Callable[..., FloatArray],
    arcs: tuple[FloatArray, ...],
    width: FloatArray,
    groups: tuple[_Group, ...],
    nodes: int,
) -> FloatArray:
    """Integral of every arc, with a number of nodes by its width."""
    values = np.empty(width.size)
    member = np.searchsorted([group.width for group in groups[:-1]], width)
    for n, group in enumerate(groups):
        rule = _clustered(max(3, round(group.share * nodes)), group.k)
        index, step = np.flatnonzero(member == n), _CHUNK // rule[0].size
        for start in range(0, index.size, step):
            part = index[start : start + step]
            values[part] = integral(*rule, *(x.take(part) for x in arcs))
    return values


def _once_hidden_arc(
    t: FloatArray,
    weight: FloatArray,
    tan: FloatArray,
    low: FloatArray,
    high: FloatArray,
    along: FloatArray,
    across: FloatArray,
) -> FloatArray:
    """Integral of (1 - along cos(phi) - across sin(phi)) / (sqrt(1 + g^2) + g).

    g = tan cos(phi).
    """
    width = high - low
    v = t * width + low
    square = v * v
    g = tan * (1 - square)
    square += 1
    root = square * square
    root += g * g
    np.sqrt(root, out=root)
    root += g
    root *= square
    seen = v * (1 + along)  # (1 - along) - 2 across v + (1 + along) v^2
    seen -= 2 * across
    seen *= v
    seen += 1 - along
    seen /= root
    return np.asarray(2 * width * (weight @ seen))


def _twice_hidden_arc(
    t: FloatArray,
    weight: FloatArray,
    low: FloatArray,
    high: FloatArray,
    p: FloatArray,
    along: FloatArray,
    across: FloatArray,
    cosine: FloatArray,
    sine: FloatArray,
) -> FloatArray:
    """Integral of (1 + x) e_2 + (x y - 1) cos - W. With R = sqrt(sin^2 + y^2 cos^2) it is sin^2 by

    1 / (R + y cos) + [y (2 x - y) - cos (x / (R + y cos) + (x - y)^2 / (W + V))] / (x R + W),

    V = (x y - 1) cos: no term is the difference of nearly equal numbers.
    """
    width, sine2 = high - low, sine * sine
    v = t * width + low
    scale = 1 / (1 + v * v)
    turned = 2 * scale - 1  # cos(phi)
    x, y = p * turned, along * turned
    v *= scale
    v *= 2 * across
    y += v
    r = y * cosine
    root = r * r
    root += sine2
    np.sqrt(root, out=root)
    r += root
    np.reciprocal(r, out=r)  # 1 / (R + y cos)
    difference = x - y
    bent = x * y
    bent -= 1
    bent *= cosine  # V
    square = difference * difference
    W = bent * bent
    W += sine2 * square
    np.sqrt(W, out=W)
    root *= x
    root += W
    bent += W
    bent += 1e-300
    square /= bent
    square += x * r
    square *= cosine
    x += difference
    x *= y
    x -= square
    x /= root
    x += r
    x *= scale
    return np.asarray(2 * width * sine2 * (weight @ x))


@cache
def _clustered(number: int, k: float) -> tuple[FloatArray, FloatArray]:
    """Nodes (number, 1) from 0 to 1 and weights, Gauss-Legendre clustered at both ends."""
    x, w = np.polynomial.legendre.leggauss(number)
    end = np.tanh(k)
    return (np.tanh(k * x[:, None]) / end + 1) / 2, w * k / np.square(np.cosh(k * x)) / end / 2
