"""Levenberg-Marquardt minimisation of a sum of squares, with bounds on the parameters.

Each damped Gauss-Newton step goes to the minimum of its quadratic model within the bounds, so that
a minimum on a bound is reached exactly. SciPy's `least_squares` finds the same minima (the tests
compare them), but one of its steps costs more than a model of 200 points.

Sources: D. W. Marquardt, Journal of the Society for Industrial and Applied Mathematics 11 (1963);
J. J. Moré, "The Levenberg-Marquardt Algorithm", Lecture Notes in Mathematics 630 (1978); P. B.
Stark and R. L. Parker, "Bounded-Variable Least-Squares", Computational Statistics 10 (1995), for
the bounds; P. J. Huber, Annals of Mathematical Statistics 35 (1964), for the robust loss.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from instrument.geometry import BoolArray, FloatArray

HUBER = 1.345
"""Residuals beyond it, in units of u, count linearly: 95 % of the efficiency of least squares."""

RTOL = 1e-10
"""The search ends with a step that lowers chi2 by no more than this fraction of it."""

MAX_STEPS = 100

_NEGLIGIBLE = 1e-13  # fraction of chi2: a smaller predicted decrease may be hidden by rounding
_ZERO = 1e-26  # a chi2 below this fraction of the first one is rounding
# Cosine between residual and gradient below which a point is stationary (Moré 1978, section 4);
# the larger one where rounding ends the search.
_STATIONARY, _ROUGHLY_STATIONARY = 1e-9, 1e-3
_FIRST_DAMPING, _MIN_DAMPING, _MAX_DAMPING = 1e-3, 1e-12, 1e12
_SHORT_STEPS = 1.0  # with more damping, steps are so short that a small gain proves no minimum
_NO_EFFECT = 1e-200  # squared derivative of the residuals, in u per unit: smaller ones underflow
_ROUNDING = 1e-12  # of the model or its derivative, relative to the sum of its terms
_MAX_FACES = 10  # of the box of bounds that one step may visit, per parameter
_CONVERGED, _NO_STEP = "chi2 has converged", "no step lowers chi2 any further"


class Minimum(NamedTuple):
    """End of a search: parameters (K,), chi2 (or the robust loss), and the reason for ending."""

    x: FloatArray
    chi2: float
    converged: bool
    message: str


class _Quadratic(NamedTuple):
    """Quadratic model of the loss at x, with bounds: half its gradient, and the matrix J^T J."""

    x: FloatArray
    low: FloatArray
    high: FloatArray
    gradient: FloatArray
    curvature: FloatArray

    def fixed(self) -> BoolArray:
        """Parameters at a bound that descent would cross, and those without effect."""
        at_low = (self.x <= self.low) & (self.gradient >= 0)
        at_high = (self.x >= self.high) & (self.gradient <= 0)
        return np.asarray(at_low | at_high | ~self.effective())

    def effective(self) -> BoolArray:
        """Parameters on which the residuals depend."""
        return np.asarray(np.diag(self.curvature) > _NO_EFFECT)

    def stationary(self, chi2: float, tolerance: float) -> bool:
        """True where no free parameter has a gradient beyond `tolerance`, as a cosine."""
        free = ~self.fixed()
        scale = np.sqrt(np.diag(self.curvature)[free]) * math.sqrt(chi2)
        return bool(np.all(np.abs(self.gradient[free]) <= tolerance * scale))

    def stationary_to_rounding(self, chi2: float) -> bool:
        """Test for a minimum where rounding of the residuals ends the search."""
        rounding = _ROUNDING**2 * float(np.diag(self.curvature) @ np.square(self.x))
        return chi2 <= rounding or self.stationary(chi2, _ROUGHLY_STATIONARY)

    def decrease(self, step: FloatArray) -> float:
        """Decrease of chi2 by a step if the residuals were linear in it."""
        return float(-step @ (2 * self.gradient + self.curvature @ step))

    def moved(self, step: FloatArray) -> FloatArray:
        """x + step, exactly on a bound where the step ends there."""
        inside = np.clip(self.x + step, self.low, self.high)
        at_high = np.where(step >= self.high - self.x, self.high, inside)
        return np.where(step <= self.low - self.x, self.low, at_high)


def loss(residual: FloatArray, huber: float | None = None) -> float:
    """Sum of squares of residuals (N,), in units of u; those beyond `huber` count linearly."""
    if huber is None:
        return float(residual @ residual)
    size = np.abs(residual)
    return float(np.sum(np.where(size <= huber, size * size, huber * (2 * size - huber))))


def weights(residual: FloatArray, huber: float | None) -> FloatArray:
    """Weights (N,) of residuals (N,), in units of u: 1, and huber / |residual| beyond `huber`."""
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
    atol: float = 0.0,
    rtol: float = RTOL,
    most_steps: int = MAX_STEPS,
) -> Minimum:
    """Minimise `loss` of `residual(x)` (N,), in units of u, from `start` with low <= x <= high.

    Parameter vectors have the shape (K,), each in its own unit; `jacobian(x)` is (N, K). The
    search ends with a step that lowers chi2 by no more than `atol`, or the fraction `rtol` of it.
    """

    def quadratic(x: FloatArray, r: FloatArray) -> _Quadratic:
        J = jacobian(x)
        weighted = J.T if huber is None else J.T * weights(r, huber)
        return _Quadratic(x, low, high, weighted @ r, weighted @ J)

    x = np.clip(start, low, high)  # rounding may put a start on a bound beyond it
    r = residual(x)
    chi2 = loss(r, huber)
    first, damping = chi2, _FIRST_DAMPING
    model = quadratic(x, r)
    for _ in range(most_steps):
        if model.stationary(chi2, _STATIONARY):
            return Minimum(x, chi2, True, "the gradient is zero")
        step = _damped_step(model, damping)
        if model.decrease(step) <= max(_NEGLIGIBLE * chi2, atol / 10):
            found = damping <= _SHORT_STEPS or model.stationary_to_rounding(chi2)
            return Minimum(x, chi2, found, _CONVERGED if found else _NO_STEP)
        new = model.moved(step)
        r = residual(new)
        reached = loss(r, huber)
        if reached < chi2:
            gain, x, chi2 = chi2 - reached, new, reached
            little = gain <= max(rtol * chi2, atol) and damping <= _SHORT_STEPS
            if little or chi2 <= _ZERO * first:
                return Minimum(x, chi2, True, _CONVERGED)
            damping = max(damping / 10, _MIN_DAMPING)
            model = quadratic(x, r)
        elif damping >= _MAX_DAMPING or np.array_equal(new, x):
            return Minimum(x, chi2, model.stationary_to_rounding(chi2), _NO_STEP)
        else:
            damping *= 10
    return Minimum(x, chi2, False, f"chi2 has not converged in {most_steps} steps")


def _damped_step(model: _Quadratic, damping: float) -> FloatArray:
    """Step to the minimum of the damped quadratic model within the bounds.

    The step goes from face to face of the box, always downhill: up to the first bound, which then
    stays fixed; at the minimum of a face, bounds that no longer block the descent are released.
    """
    A = model.curvature + damping * np.diag(np.diag(model.curvature))
    down, up = model.low - model.x, model.high - model.x
    step, free = np.zeros_like(model.x), ~model.fixed()
    for _ in range(_MAX_FACES * step.size):
        step, hit = _step_in_face(A, model.gradient, step, free, down, up)
        free &= ~hit
        if np.any(hit):
            continue
        gradient = model.gradient + A @ step
        noise = _ROUNDING * (np.abs(model.gradient) + np.abs(A) @ np.abs(step))
        released = ((step <= down) & (gradient < -noise)) | ((step >= up) & (gradient > noise))
        released &= model.effective()
        if not np.any(released):
            break
        free |= released
    return step


def _step_in_face(
    A: FloatArray,
    gradient: FloatArray,
    step: FloatArray,
    free: BoolArray,
    down: FloatArray,
    up: FloatArray,
) -> tuple[FloatArray, BoolArray]:
    """Extend the step to the minimum over the `free` parameters; mark a bound that is hit first."""
    target = step.copy()
    given = A[np.ix_(free, ~free)] @ step[~free]
    target[free] = _solve_scaled(A[np.ix_(free, free)], -gradient[free] - given)
    over = (target < down) | (target > up)
    if not np.any(over):
        return target, over
    bound, part = np.where(target < step, down, up), np.ones_like(step)
    part[over] = ((bound - step)[over]) / ((target - step)[over])
    hit = over & (part <= np.min(part))
    return np.where(hit, bound, step + np.min(part) * (target - step)), hit


def _solve_scaled(A: FloatArray, b: FloatArray) -> FloatArray:
    """A^-1 b of a positive matrix, solved in units in which its diagonal is 1."""
    scale = np.sqrt(np.diag(A))
    return np.asarray(np.linalg.solve(A / scale / scale[:, np.newaxis], b / scale) / scale)
