"""Descent to the minimum of a sum of squares within bounds.

Levenberg's and Marquardt's damped Gauss-Newton steps; a parameter that a step would carry beyond
its bound is set on the bound and the step taken anew in the others, so that a minimum on a bound is
reached exactly. SciPy's `least_squares` finds the same minima (the tests compare), but a step costs
it more than a model of 200 points does.

Sources: D. W. Marquardt, Journal of the Society for Industrial and Applied Mathematics 11 (1963);
J. J. Moré, "The Levenberg-Marquardt Algorithm", Lecture Notes in Mathematics 630 (1978); P. J.
Huber, Annals of Mathematical Statistics 35 (1964), for the robust loss.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from analysis.models.base import BoolArray
from instrument.geometry import FloatArray

HUBER = 1.345
"""Residuals beyond it, in units of u, count linearly: 95 % of the efficiency of least squares."""

_MOST_STEPS = 100
_SETTLED = 1e-10  # a step that lowers chi2 by less than this part of it is the last
_NOT_WORTH = 1e-13  # a step that promises less is not taken: rounding may hide what it brings
_NOTHING_LEFT = 1e-26  # chi2 below this part of the first one is rounding
# Cosine between residual and slopes below which there is no way down (Moré 1978, section 4); the
# larger one where rounding ends the search.
_FLAT, _ROUGHLY_FLAT = 1e-9, 1e-3
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e-12, 1e12


class Minimum(NamedTuple):
    """Where a descent ended: parameters, chi2 (or the robust loss), and why it stopped there."""

    x: FloatArray
    chi2: float
    converged: bool
    message: str


class _Slope(NamedTuple):
    """Half the gradient of the loss and Gauss's and Newton's matrix."""

    gradient: FloatArray
    curvature: FloatArray


def loss(residual: FloatArray, huber: float | None = None) -> float:
    """Sum of squares of residuals (N,); with `huber` the part beyond it counts linearly."""
    if huber is None:
        return float(residual @ residual)
    size = np.abs(residual)
    return float(np.sum(np.where(size <= huber, size * size, huber * (2 * size - huber))))


def weights(residual: FloatArray, huber: float | None) -> FloatArray:
    """What a residual counts, (N,): 1, and huber / |residual| beyond `huber`."""
    if huber is None:
        return np.ones_like(residual)
    return huber / np.maximum(np.abs(residual), huber)


def descend(
    residual: Callable[[FloatArray], FloatArray],
    jacobian: Callable[[FloatArray], FloatArray],
    start: FloatArray,
    low: FloatArray,
    high: FloatArray,
    huber: float | None = None,
    enough: float = 0.0,
) -> Minimum:
    """The minimum of `loss` of `residual(x)` (N,) with low <= x <= high (K,), down from `start`.

    `jacobian(x)` is (N, K). A step that lowers chi2 by no more than `enough` is the last.
    """
    x, r = start, residual(start)
    chi2 = loss(r, huber)
    first, damping = chi2, _FIRST_DAMPING
    slope = _slope(r, jacobian(x), huber)
    for _ in range(_MOST_STEPS):
        if _no_way_down(slope, x, low, high, chi2, _FLAT):
            return Minimum(x, chi2, True, "no slope is left")
        step = _step(slope, x, low, high, damping)
        if _promised(slope, step) <= max(_NOT_WORTH * chi2, enough / 10):
            return Minimum(x, chi2, True, "chi2 has settled")
        new = np.clip(x + step, low, high)
        r = residual(new)
        reached = loss(r, huber)
        if reached < chi2:
            gain, x, chi2 = chi2 - reached, new, reached
            if gain <= max(_SETTLED * chi2, enough) or chi2 <= _NOTHING_LEFT * first:
                return Minimum(x, chi2, True, "chi2 has settled")
            damping = max(damping / 10, _LEAST_DAMPING)
            slope = _slope(r, jacobian(x), huber)
        elif damping >= _MOST_DAMPING or np.array_equal(new, x):
            flat = _no_way_down(slope, x, low, high, chi2, _ROUGHLY_FLAT)
            return Minimum(x, chi2, flat, "no step lowers chi2 any more")
        else:
            damping *= 10
    return Minimum(x, chi2, False, f"chi2 has not settled in {_MOST_STEPS} steps")


def _slope(r: FloatArray, J: FloatArray, huber: float | None) -> _Slope:
    if huber is None:
        return _Slope(J.T @ r, J.T @ J)
    weighted = J.T * weights(r, huber)
    return _Slope(weighted @ r, weighted @ J)


def _held(slope: _Slope, x: FloatArray, low: FloatArray, high: FloatArray) -> BoolArray:
    """Parameters on a bound that the way down would cross, and those that change nothing."""
    on_low, on_high = (x <= low) & (slope.gradient >= 0), (x >= high) & (slope.gradient <= 0)
    return np.asarray(on_low | on_high | (np.diag(slope.curvature) <= 0))


def _no_way_down(
    slope: _Slope, x: FloatArray, low: FloatArray, high: FloatArray, chi2: float, flat: float
) -> bool:
    free = ~_held(slope, x, low, high)
    scale = np.sqrt(np.diag(slope.curvature)[free] * chi2)
    return bool(np.all(np.abs(slope.gradient[free]) <= flat * scale))


def _step(
    slope: _Slope, x: FloatArray, low: FloatArray, high: FloatArray, damping: float
) -> FloatArray:
    """The damped step; parameters that it would carry over a bound go as far as the bound."""
    A = slope.curvature + damping * np.diag(np.diag(slope.curvature))
    step, free = np.zeros_like(x), ~_held(slope, x, low, high)
    while np.any(free):
        given = A[np.ix_(free, ~free)] @ step[~free]
        step[free] = _solve(A[np.ix_(free, free)], -slope.gradient[free] - given)
        over = free & ((x + step < low) | (x + step > high))
        if not np.any(over):
            break
        step[over] = np.where(step < 0, low - x, high - x)[over]
        free &= ~over
    return step


def _promised(slope: _Slope, step: FloatArray) -> float:
    """By how much a step lowers chi2 if the residuals are linear in it."""
    return float(-step @ (2 * slope.gradient + slope.curvature @ step))


def _solve(A: FloatArray, b: FloatArray) -> FloatArray:
    """A^-1 b of a positive matrix in units in which its diagonal is 1."""
    scale = np.sqrt(np.diag(A))
    return np.asarray(np.linalg.solve(A / np.outer(scale, scale), b / scale) / scale)
