"""Sums e^{-g} Σ_{m≥1} g^m/m! w(m) e^{-q/m}: those of Beckmann and Spizzichino's lobe.

`poisson_sum` gives one. `poisson_terms`, kept, give several with the same g and q and other weights
w, such as a lobe and its derivatives, at little more than the cost of one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from instrument.geometry import FloatArray, IntArray

Weight = Callable[..., FloatArray]  # of m, g and q

BLOCK = 512  # elements at a time: with all their terms they stay in a core's own cache
TERMWISE_BELOW = 40.0  # largest term from which on the sum is computed as an integral
STEP = 0.75  # of a standard deviation of the summand: the trapezoid's error is e^{-2π²/0.75²}
LEFT, RIGHT = 10, 13  # steps to either side: beyond them less than 1e-13 of a Poisson's sum
TINY = 1e-300


class Terms(NamedTuple):
    """Terms (M, P) of the sums at P elements, of M numbers `m`, which may differ between elements.

    `at` are the places (P,) of the elements, `g` and `q` their own (P,), `h` the step from m to m.
    """

    at: IntArray
    m: FloatArray
    g: FloatArray
    q: FloatArray
    h: FloatArray | float
    terms: FloatArray

    def sum(self, weight: Weight) -> FloatArray:
        """Sum (P,) with these weights, dimensionless."""
        with np.errstate(under="ignore"):
            weighted = self.terms * weight(self.m, self.g, self.q)
            return np.asarray(self.h * np.sum(weighted, axis=0))


def poisson_sum(g: FloatArray, q: FloatArray, weight: Weight) -> FloatArray:
    """e^{-g} Σ_{m≥1} g^m/m! w(m) e^{-q/m}, element by element; w is smooth, as 1/m is in (18).

    `g` and `q`, dimensionless, broadcast to the result's shape. A largest term below m = 40: summed
    over all terms that count (up to 110). Beyond, the summand is a smooth bell of width s ≥ 1: by
    Poisson's summation formula its sum over integers and its sum in steps of h, times h, both are
    its integral but for e^{-2π²(s/h)²}. 24 nodes, 0.75 s apart, then are enough at any g; where s
    is so narrow that h would be below 1, h = 1 is the sum itself. Largest relative error against
    sums of 25 digits: 2e-11 (g 18, q 1400: a skewed bell).
    """
    g, q = np.broadcast_arrays(g, q)
    return summed(poisson_terms(g, q), weight, g.shape)


def poisson_terms(g: FloatArray, q: FloatArray) -> Iterator[Terms]:
    """Terms of `poisson_sum` for arrays g and q of one shape, dimensionless, some elements a time.

    Kept, they give sums with several weights, such as a lobe and its derivatives.
    """
    flat_g, flat_q = g.ravel(), q.ravel()
    for start in range(0, flat_g.size, BLOCK):
        at = np.arange(start, min(start + BLOCK, flat_g.size))
        with np.errstate(under="ignore"):
            parts = _block(at, flat_g[at], flat_q[at])
        yield from parts


def _block(at: IntArray, g: FloatArray, q: FloatArray) -> list[Terms]:
    peak = largest_term(g, q)
    few = peak < TERMWISE_BELOW
    ways = (few, _termwise), (~few, _in_wide_steps)
    return [way(at[k], g[k], q[k], peak[k]) for k, way in ways if k.any()]


def summed(parts: Iterable[Terms], weight: Weight, shape: tuple[int, ...]) -> FloatArray:
    """Sums of the given shape with these weights, dimensionless."""
    total = np.empty(math.prod(shape))
    for part in parts:
        total[part.at] = part.sum(weight)
    return total.reshape(shape)


def largest_term(g: FloatArray, q: FloatArray) -> FloatArray:
    """The m, not rounded, near which g^m/m! e^{-q/m} is largest: m² ln(m/g) = q, any shape.

    m = g e^{W/2} with W e^W = 2q/g² (Lambert's W): a start good to 2 % and two steps of
    R. Iacono, J. P. Boyd, Advances in Computational Mathematics 43 (2017), good to 1e-9.
    """
    g = np.maximum(g, 1e-100)
    y = np.maximum(2 * q / np.square(g), TINY)
    log = np.log1p(y)
    W = log * (1 - np.log1p(log) / (2 + log))
    for _ in range(2):
        W = W / (1 + W) * (1 + np.log(y / W))
    return np.asarray(g * np.exp(W / 2))


def _termwise(at: IntArray, g: FloatArray, q: FloatArray, peak: FloatArray) -> Terms:
    """All terms up to 9 standard deviations and 12 terms beyond the largest `peak`."""
    most = float(peak.max())
    m = np.arange(1.0, math.ceil(most + 9 * math.sqrt(most) + 12) + 1)[:, np.newaxis]
    with np.errstate(divide="ignore"):  # g = 0: every term is 0
        exponent = m * np.log(g)
    exponent -= np.cumsum(np.log(m), axis=0)
    exponent -= g
    exponent -= q / m
    return Terms(at, m, g, q, 1.0, np.exp(exponent, out=exponent))


def _in_wide_steps(at: IntArray, g: FloatArray, q: FloatArray, peak: FloatArray) -> Terms:
    """Terms in steps of h around the largest one."""
    g = np.maximum(g, TINY)
    h = np.maximum(1.0, STEP * np.sqrt(peak / (1 + 2 * q / np.square(peak))))
    steps = np.arange(-LEFT, RIGHT + 1.0)[:, np.newaxis]
    m = np.maximum(np.rint(peak) + steps * h, 0.5)  # terms so far down are negligible
    return Terms(at, m, g, q, h, poisson_term(m, g) * np.exp(-q / m))


def poisson_term(m: FloatArray, g: FloatArray) -> FloatArray:
    """e^{-g} g^m/m! for real m above 10, to 1e-13 and the rounding of m - g; `m`, `g` broadcast.

    Dimensionless. By Stirling's series for m!, and g - m + m ln(m/g) = g ((1+d) ln(1+d) - d) with
    m = g (1+d): the exponents, which are as large as m ln g, never stand alone.
    """
    d = (m - g) / g
    r = 1 / m
    stirling = r * (1 / 12 - r * r * (1 / 360 - r * r / 1260))
    return np.exp(-g * ((1 + d) * np.log1p(d) - d) - stirling) / np.sqrt(2 * math.pi * m)
