"""How well a fit determines its parameters: standard uncertainties, or intervals where none holds.

A standard uncertainty describes a parameter only where chi2 is about a parabola that fits into
the parameter's domain, which is tried 2 u to either side along the valley that the linearised fit
expects. Elsewhere (on a bound, in a bent valley, or where the data hardly depend on the parameter)
the profile-likelihood interval is given instead. So it is where a standard uncertainty rests on
another parameter's lying on its bound: with an albedo of 1 that may as well be 0.5, a lobe's
strength is not known.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from analysis.fit.levenberg_marquardt import Minimum
from analysis.fit.problem import Problem
from analysis.fit.profile_likelihood import RISE_95, interval
from instrument.geometry import BoolArray, FloatArray

# Below this part of the largest singular value a combination of parameters is not determined.
_RANK = 1e-7
# A parameter moves the data at least so many standard deviations over all of its domain.
_LEAST_EFFECT = 1e-3
# An interval may differ by this factor from 1.96 u before u is held to be misleading.
_PARABOLA = 1.4


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """u by parameter name (None where none holds), intervals for those, and correlations.

    `undetermined` names the parameters that may lie anywhere in more than half of their domain.
    `correlation` is (K, K) in the model's order, NaN for a parameter that has no u.
    """

    u: Mapping[str, float | None]
    intervals: Mapping[str, tuple[float, float]]
    undetermined: tuple[str, ...]
    correlation: FloatArray


def uncertainty(
    problem: Problem,
    best: Minimum,
    variance: float,
    unscaled_parameters: Collection[str] = (),
    profiles: bool = True,
) -> Uncertainty:
    """Uncertainties of the parameters at a minimum, in their own units.

    `variance` is that of the whitened residuals: 1 where the data's u is stated, else estimated.
    `unscaled_parameters`: parameters that no reference ties down, so not determined.
    Without `profiles` an interval is the whole domain.
    """
    bound = (best.x == problem.low) | (best.x == problem.high)
    C, loose = _linear(problem, best.x, variance, ~bound)
    loose |= [p.name in unscaled_parameters for p in problem.model.parameters]
    leaning = _leaning(problem, best.x, variance, C, bound)
    around = _Around(problem, best, variance, C, profiles)
    u: dict[str, float | None] = {}
    intervals: dict[str, tuple[float, float]] = {}
    undetermined = []
    for i, parameter in enumerate(problem.model.parameters):
        u[parameter.name], ends = around.known(i, bool(loose[i]), bool(leaning[i]))
        if ends is None:
            continue
        intervals[parameter.name] = ends
        if parameter.name in unscaled_parameters or ends[1] - ends[0] > around.half(i):
            undetermined.append(parameter.name)
    return Uncertainty(u, intervals, tuple(undetermined), _correlation(C, list(u.values())))


def _leaning(
    problem: Problem, x: FloatArray, variance: float, C: FloatArray, bound: BoolArray
) -> BoolArray:
    """Parameters whose u rests on others' being held on a `bound`, which may leave it."""
    if not np.any(bound):
        return bound
    off = problem.off_level_bounds(x, range(x.size))
    freed, loose = _linear(problem, off, variance, np.ones_like(bound))
    wider = np.diag(freed) > _PARABOLA**2 * np.diag(C)
    return np.asarray(wider | loose)


def _linear(
    problem: Problem, x: FloatArray, variance: float, varied: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Linearised covariance of the `varied` parameters, (K, K), and which it does not hold for."""
    loose = ~varied
    C = np.full((x.size, x.size), np.nan)
    free = np.flatnonzero(varied)
    if free.size == 0:
        return C, loose
    J = problem.jacobian(x, free.tolist())
    norm = np.linalg.norm(J, axis=0)
    live = norm * (problem.high - problem.low)[free] > _LEAST_EFFECT * np.sqrt(variance)
    loose[free[~live]] = True
    free, J, norm = free[live], J[:, live], norm[live]
    if free.size == 0:
        return C, loose
    _, S, Vt = np.linalg.svd(J / norm, full_matrices=False)
    known = _RANK * S[0] < S
    loose[free] |= np.any(np.abs(Vt[~known]) > 0.1, axis=0)
    root = Vt[known].T / S[known]
    C[np.ix_(free, free)] = variance * (root @ root.T) / np.outer(norm, norm)
    return C, loose


@dataclass(frozen=True, slots=True)
class _Around:
    """What is around a minimum: a parabola of covariance C, or something else."""

    problem: Problem
    best: Minimum
    variance: float
    C: FloatArray
    profiles: bool

    def half(self, i: int) -> float:
        """Half of a parameter's domain."""
        return float(self.problem.high[i] - self.problem.low[i]) / 2

    def known(
        self, i: int, loose: bool, leaning: bool
    ) -> tuple[float | None, tuple[float, float] | None]:
        """A parameter's u, or None and the interval in which it lies."""
        u = None if loose else float(np.sqrt(self.C[i, i]))
        if u is not None and 2 * np.sqrt(RISE_95) * u > self.half(i):
            u = None
        if u is not None and not leaning and self.straight(i):
            return u, None
        ends = float(self.problem.low[i]), float(self.problem.high[i])
        if self.profiles:
            ends = interval(self.problem, self.best, i, RISE_95 * self.variance)
        return (u, None) if u is not None and self.parabola(i, u, ends) else (None, ends)

    def straight(self, i: int) -> bool:
        """Whether chi2 rises 2 u away along the expected valley about as a parabola does."""
        # What is not varied has no covariance.
        step = 2 * np.nan_to_num(self.C[:, i]) / np.sqrt(self.C[i, i])
        expected = 4 * self.variance
        for x in (self.best.x - step, self.best.x + step):
            if np.any((x < self.problem.low) | (self.problem.high < x)):
                return False
            rise = self.problem.chi2(x) - self.best.chi2
            if not expected / _PARABOLA**2 < rise < expected * _PARABOLA**2:
                return False
        return True

    def parabola(self, i: int, u: float, ends: tuple[float, float]) -> bool:
        """Whether the ends are where u says; one of them may lie on a bound before that."""
        expected = np.sqrt(RISE_95) * u
        inside = 0
        for end, bound in zip(ends, (self.problem.low[i], self.problem.high[i]), strict=True):
            distance = abs(end - self.best.x[i])
            if distance > expected * _PARABOLA:
                return False
            if end != bound:
                inside += 1
                if distance < expected / _PARABOLA:
                    return False
        return inside > 0


def _correlation(C: FloatArray, u: list[float | None]) -> FloatArray:
    scale = np.array([np.nan if value is None else value for value in u])
    return np.asarray(C / np.outer(scale, scale))
