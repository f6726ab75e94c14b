"""Descent to the minimum of a sum of squares within bounds.

Levenberg's and Marquardt's damped Gauss-Newton steps, each to the minimum within the bounds of its
parabola, so that a minimum on a bound is reached exactly. SciPy's `least_squares` finds the same
minima (the tests compare), but a step costs it more than a model of 200 points does.

Sources: D. W. Marquardt, Journal of the Society for Industrial and Applied Mathematics 11 (1963);
J. J. Moré, "The Levenberg-Marquardt Algorithm", Lecture Notes in Mathematics 630 (1978); P. B.
Stark and R. L. Parker, "Bounded-Variable Least-Squares", Computational Statistics 10 (1995), for
the bounds; P. J. Huber, Annals of Mathematical Statistics 35 (1964), for the robust loss.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from instrument.geometry import BoolArray, FloatArray

HUBER = 1.345
"""Residuals beyond it, in units of u, count linearly: 95 % of the efficiency of least squares."""

_MOST_STEPS = 100
SETTLED = 1e-10
"""A step that lowers chi2 by less than this part of it is the last."""

_NOT_WORTH = 1e-13  # a step that promises less is not taken: rounding may hide what it brings
_NOTHING_LEFT = 1e-26  # chi2 below this part of the first one is rounding
# Cosine between residual and slopes below which there is no way down (Moré 1978, section 4); the
# larger one where rounding ends the search.
_FLAT, _ROUGHLY_FLAT = 1e-9, 1e-3
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e-12, 1e12
_SHORT = 1.0  # steps damped more are so short that little gain does not mean a minimum
_ROUNDING = 1e-12  # of a model or of a slope, relative to what it is the sum of
_MOST_FACES = 10  # of the box of bounds, per parameter, that a step visits
_NO_STEP = "no step lowers chi2 any more"


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
    settled: float = SETTLED,
) -> Minimum:
    """The minimum of `loss` of `residual(x)` (N,) with low <= x <= high (K,), down from `start`.

    `jacobian(x)` is (N, K). A step that lowers chi2 by no more than `enough`, or by no more than
    the part `settled` of it, is the last.
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
            rests = damping <= _SHORT or _at_rest(slope, x, low, high, chi2)
            return Minimum(x, chi2, rests, "chi2 has settled" if rests else _NO_STEP)
        new = _moved(x, step, low, high)
        r = residual(new)
        reached = loss(r, huber)
        if reached < chi2:
            gain, x, chi2 = chi2 - reached, new, reached
            little = gain <= max(settled * chi2, enough) and damping <= _SHORT
            if little or chi2 <= _NOTHING_LEFT * first:
                return Minimum(x, chi2, True, "chi2 has settled")
            damping = max(damping / 10, _LEAST_DAMPING)
            slope = _slope(r, jacobian(x), huber)
        elif damping >= _MOST_DAMPING or np.array_equal(new, x):
            return Minimum(x, chi2, _at_rest(slope, x, low, high, chi2), _NO_STEP)
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


def _at_rest(slope: _Slope, x: FloatArray, low: FloatArray, high: FloatArray, chi2: float) -> bool:
    """Whether a search that rounding ends has come to a minimum, if perhaps one of rounding."""
    rounding = _ROUNDING**2 * float(np.diag(slope.curvature) @ np.square(x))
    return chi2 <= rounding or _no_way_down(slope, x, low, high, chi2, _ROUGHLY_FLAT)


def _step(
    slope: _Slope, x: FloatArray, low: FloatArray, high: FloatArray, damping: float
) -> FloatArray:
    """The damped step: to the minimum of its parabola within the bounds.

    From face to face of the box, downhill all the way: as far as the first bound, which is held
    from then on; at the minimum of a face, bounds that are in the way no more are let go.
    """
    A = slope.curvature + damping * np.diag(np.diag(slope.curvature))
    down, up = low - x, high - x
    step, free = np.zeros_like(x), ~_held(slope, x, low, high)
    for _ in range(_MOST_FACES * x.size):
        step, hit = _in_face(A, slope.gradient, step, free, down, up)
        free &= ~hit
        if np.any(hit):
            continue
        uphill = slope.gradient + A @ step
        noise = _ROUNDING * (np.abs(slope.gradient) + np.abs(A) @ np.abs(step))
        freed = ((step <= down) & (uphill < -noise)) | ((step >= up) & (uphill > noise))
        if not np.any(freed):
            break
        free |= freed
    return step


def _in_face(
    A: FloatArray,
    gradient: FloatArray,
    step: FloatArray,
    free: BoolArray,
    down: FloatArray,
    up: FloatArray,
) -> tuple[FloatArray, BoolArray]:
    """The step on to the minimum over the `free` parameters, and which bound ends it before."""
    aim = step.copy()
    given = A[np.ix_(free, ~free)] @ step[~free]
    aim[free] = _solve(A[np.ix_(free, free)], -gradient[free] - given)
    over = (aim < down) | (aim > up)
    if not np.any(over):
        return aim, over
    bound, part = np.where(aim < step, down, up), np.ones_like(step)
    part[over] = ((bound - step)[over]) / ((aim - step)[over])
    hit = over & (part <= np.min(part))
    return np.where(hit, bound, step + np.min(part) * (aim - step)), hit


def _moved(x: FloatArray, step: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """x + step, exactly on a bound where the step ends there."""
    inside = np.clip(x + step, low, high)
    return np.where(step <= low - x, low, np.where(step >= high - x, high, inside))


def _promised(slope: _Slope, step: FloatArray) -> float:
    """By how much a step lowers chi2 if the residuals are linear in it."""
    return float(-step @ (2 * slope.gradient + slope.curvature @ step))


def _solve(A: FloatArray, b: FloatArray) -> FloatArray:
    """A^-1 b of a positive matrix in units in which its diagonal is 1."""
    scale = np.sqrt(np.diag(A))
    return np.asarray(np.linalg.solve(A / np.outer(scale, scale), b / scale) / scale)
