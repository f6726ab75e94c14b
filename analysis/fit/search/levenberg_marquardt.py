"""Levenberg-Marquardt minimisation of a sum of squares, with bounds on the parameters.

Each damped Gauss-Newton step goes to the minimum of its quadratic model within the bounds, so that
a minimum on a bound is reached exactly. Where residuals are large, an estimate of their second
derivatives is added to the model as long as that predicts better. SciPy's `least_squares` finds the
same minima (the tests compare them), but one of its steps costs more than a model of 200 points.

Sources: D. W. Marquardt, Journal of the Society for Industrial and Applied Mathematics 11 (1963);
J. J. Moré, "The Levenberg-Marquardt Algorithm", Lecture Notes in Mathematics 630 (1978); H. B.
Nielsen, "Damping Parameter in Marquardt's Method", report IMM-REP-1999-05 (1999); J. E. Dennis,
D. M. Gay, R. E. Welsch, "An Adaptive Nonlinear Least-Squares Algorithm", ACM Transactions on
Mathematical Software 7 (1981), for the second derivatives; P. B. Stark and R. L. Parker,
"Bounded-Variable Least-Squares", Computational Statistics 10 (1995), for the bounds; P. J. Huber,
Annals of Mathematical Statistics 35 (1964), for the robust loss.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
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
_GROWTH, _LEAST_CUT = 2.0, 0.1  # of the damping after a step that fails, and after a good one
_CONVEX = 1e-12  # least eigenvalue of a Hessian that is used, relative to its Gauss-Newton part
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


@dataclass(frozen=True, slots=True)
class _Quadratic:
    """Quadratic model of half the loss at x, (K,), within bounds: its gradient and its Hessian.

    J: derivatives (N, K) of the residuals. gauss_newton: J^T J, with its `diagonal`. hessian: the
    same, or with the second derivatives of the residuals. free: parameters with an effect that are
    not at a bound which descent would cross.
    """

    x: FloatArray
    low: FloatArray
    high: FloatArray
    J: FloatArray
    gradient: FloatArray
    gauss_newton: FloatArray
    hessian: FloatArray
    diagonal: FloatArray
    free: BoolArray

    @classmethod
    def of(
        cls,
        x: FloatArray,
        bounds: tuple[FloatArray, FloatArray],
        J: FloatArray,
        r: FloatArray,
        huber: float | None,
    ) -> _Quadratic:
        """Model of residuals r (N,) with derivatives J (N, K), without their second ones."""
        low, high = bounds
        weighted = _weighted(J, r, huber)
        gradient, gauss_newton = weighted @ r, weighted @ J
        diagonal = gauss_newton.diagonal()
        free = ((x > low) | (gradient < 0)) & ((x < high) | (gradient > 0))
        free &= diagonal > _NO_EFFECT
        return cls(x, low, high, J, gradient, gauss_newton, gauss_newton, diagonal, free)

    def stationary(self, chi2: float, tolerance: float) -> bool:
        """True where no free parameter has a gradient beyond `tolerance`, as a cosine."""
        limit = tolerance * np.sqrt(self.diagonal * chi2)
        return bool((~self.free | (np.abs(self.gradient) <= limit)).all())

    def stationary_to_rounding(self, chi2: float) -> bool:
        """Test for a minimum where rounding of the residuals ends the search."""
        rounding = _ROUNDING**2 * float(self.diagonal @ np.square(self.x))
        return chi2 <= rounding or self.stationary(chi2, _ROUGHLY_STATIONARY)

    def decrease(self, step: FloatArray) -> float:
        """Decrease of the loss by a step if this model were exact."""
        return float(-step @ (2 * self.gradient + self.hessian @ step))

    def moved(self, step: FloatArray) -> FloatArray:
        """x + step, exactly on a bound where the step ends there."""
        inside = np.minimum(np.maximum(self.x + step, self.low), self.high)
        at_high = np.where(step >= self.high - self.x, self.high, inside)
        return np.where(step <= self.low - self.x, self.low, at_high)


@dataclass(slots=True)
class _SecondDerivatives:
    """Sum of residuals times their second derivatives, (K, K), as the gradient's changes show it.

    Where residuals are large, steps without it crawl. The estimate counts as long as the model
    with it predicts chi2 better than the one without. Dennis, Gay and Welsch (1981).
    """

    S: FloatArray
    used: bool = False

    def judge(self, gauss_newton: _Quadratic, step: FloatArray, gain: float) -> None:
        """Use, for the next step, the model which predicted the gain by the last one better."""
        more = float(step @ self.S @ step)
        without = gauss_newton.decrease(step) if more else 0.0
        self.used = more != 0 and abs(without - more - gain) < abs(without - gain)

    def update(self, old: _Quadratic, new: _Quadratic, r: FloatArray, huber: float | None) -> None:
        """Take in a step, to where the residuals are r: S explains what J^T J does not."""
        step, change = new.x - old.x, new.gradient - old.gradient
        by_residuals = new.gradient - _weighted(old.J, r, huber) @ r
        along = float(change @ step)
        if not along > 0:
            return
        with np.errstate(all="ignore"):
            known = self.S @ step
            size = float(step @ known)
            shrink = min(1.0, abs(float(step @ by_residuals) / size)) if size else 0.0
            more, change = by_residuals - shrink * known, change / along
            both = np.outer(more, change)
            S = shrink * self.S + both + both.T - float(more @ step) * np.outer(change, change)
        if np.isfinite(S).all():
            self.S = S

    def added(self, model: _Quadratic) -> _Quadratic:
        """The model with this Hessian, if it counts and leaves the model convex."""
        if not self.used:
            return model
        on = model.diagonal > _NO_EFFECT
        hessian = model.gauss_newton + (self.S if on.all() else self.S * np.outer(on, on))
        part, size = hessian[on][:, on], np.sqrt(model.diagonal[on])
        if not on.any() or np.linalg.eigvalsh(part / size / size[:, np.newaxis])[0] < _CONVEX:
            return model
        return replace(model, hessian=hessian)


@dataclass(slots=True)
class _Damping:
    """Damping, relative to the diagonal of J^T J: less, the better the model. Nielsen (1999)."""

    value: float = _FIRST_DAMPING
    growth: float = _GROWTH

    def lower(self, gain: float, predicted: float) -> None:
        """After a step that lowered chi2 by `gain`."""
        by = 1 - (2 * gain / predicted - 1) ** 3
        self.value = max(self.value * max(_LEAST_CUT, by), _MIN_DAMPING)
        self.growth = _GROWTH

    def raise_(self) -> None:
        """After a step that did not lower chi2: faster from step to step."""
        self.value *= self.growth
        self.growth *= _GROWTH


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


def _weighted(J: FloatArray, r: FloatArray, huber: float | None) -> FloatArray:
    return J.T if huber is None else J.T * weights(r, huber)


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

    bounds = low, high
    x = np.clip(start, low, high)  # rounding may put a start on a bound beyond it
    r = residual(x)
    first = chi2 = loss(r, huber)
    model = plain = _Quadratic.of(x, bounds, jacobian(x), r, huber)
    damping, second = _Damping(), _SecondDerivatives(np.zeros((x.size, x.size)))
    for _ in range(most_steps):
        if model.stationary(chi2, _STATIONARY):
            return Minimum(x, chi2, True, "the gradient is zero")
        step, short = _damped_step(model, damping.value), damping.value > _SHORT_STEPS
        predicted = model.decrease(step)
        if predicted <= max(_NEGLIGIBLE * chi2, atol / 10):
            found = not short or model.stationary_to_rounding(chi2)
            return Minimum(x, chi2, found, _CONVERGED if found else _NO_STEP)
        new = model.moved(step)
        r = residual(new)
        reached = loss(r, huber)
        gain = chi2 - reached
        second.judge(plain, step, gain)
        if gain > 0:
            x, chi2 = new, reached
            if (gain <= max(rtol * chi2, atol) and not short) or chi2 <= _ZERO * first:
                return Minimum(x, chi2, True, _CONVERGED)
            damping.lower(gain, predicted)
            old, plain = plain, _Quadratic.of(x, bounds, jacobian(x), r, huber)
            second.update(old, plain, r, huber)
        elif damping.value >= _MAX_DAMPING or np.array_equal(new, x):
            return Minimum(x, chi2, model.stationary_to_rounding(chi2), _NO_STEP)
        else:
            damping.raise_()
        model = second.added(plain)
    return Minimum(x, chi2, False, f"chi2 has not converged in {most_steps} steps")


def _damped_step(model: _Quadratic, damping: float) -> FloatArray:
    """Step to the minimum of the damped quadratic model within the bounds.

    The step goes from face to face of the box, always downhill: up to the first bound, which then
    stays fixed; at the minimum of a face, bounds that no longer block the descent are released.
    """
    A = model.hessian + np.diag(damping * model.diagonal)
    down, up = model.low - model.x, model.high - model.x
    step, free = np.zeros_like(model.x), model.free
    for _ in range(_MAX_FACES * step.size):
        step, hit = _step_in_face(A, model.gradient, step, free, down, up)
        free = free & ~hit
        if hit.any():
            continue
        at_low, at_high = step <= down, step >= up
        if not (at_low | at_high).any():
            break
        gradient = model.gradient + A @ step
        noise = _ROUNDING * (np.abs(model.gradient) + np.abs(A) @ np.abs(step))
        released = (at_low & (gradient < -noise)) | (at_high & (gradient > noise))
        released &= model.diagonal > _NO_EFFECT
        if not released.any():
            break
        free = free | released
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
    target, descent = step.copy(), -(gradient + A @ step)
    target[free] += _solve_scaled(A[free][:, free], descent[free])
    over = (target < down) | (target > up)
    if not over.any():
        return target, over
    bound, part = np.where(target < step, down, up), np.ones_like(step)
    part[over] = ((bound - step)[over]) / ((target - step)[over])
    hit = over & (part <= np.min(part))
    return np.where(hit, bound, step + np.min(part) * (target - step)), hit


def _solve_scaled(A: FloatArray, b: FloatArray) -> FloatArray:
    """A^-1 b of a positive matrix, solved in units in which its diagonal is 1."""
    scale = np.sqrt(A.diagonal())
    return np.asarray(np.linalg.solve(A / scale / scale[:, np.newaxis], b / scale) / scale)
