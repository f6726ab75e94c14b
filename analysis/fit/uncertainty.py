"""Uncertainty of fitted parameters: a standard uncertainty, or an interval where none is valid.

A standard uncertainty describes a parameter only where chi2 is nearly a parabola that fits into the
parameter's domain. This is checked 2 u to either side, along the valley of the linearised fit.
Elsewhere (on a bound, in a curved valley, or where the data hardly depend on the parameter) the
profile-likelihood interval is given instead; likewise where the standard uncertainty depends on
another parameter's being at its bound: with an albedo of 1 that could as well be 0.5, the strength
of a lobe is not known.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from analysis.fit.profile_likelihood import RISE_95, interval
from analysis.fit.search.levenberg_marquardt import Minimum
from analysis.fit.search.problem import Problem
from instrument.geometry import BoolArray, FloatArray

# Singular values below this fraction of the largest: a combination that is not determined.
_RANK = 1e-7
# A parameter changes the data by at least this many standard deviations over all of its domain.
_MIN_EFFECT = 1e-3
# An interval within this factor of 1.96 u agrees with u.
_AGREEMENT = 1.4


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """u by parameter name (None where not valid), intervals for those, and correlations.

    `undetermined` names the parameters whose interval is more than half of their domain.
    `correlation` is (K, K) in the model's order, NaN for a parameter without u.
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
    only: Collection[str] | None = None,
) -> Uncertainty:
    """Uncertainties of the parameters at a minimum, in their own units.

    `variance` is that of the whitened residuals: 1 where the data's u is stated, else estimated.
    `unscaled_parameters`: those that need a reference which was not measured, so not determined.
    Without `profiles` an interval is the whole domain. `only`: names of the parameters wanted.
    """
    bound = (best.x == problem.low) | (best.x == problem.high)
    C, invalid = _linearised(problem, best.x, variance, ~bound)
    invalid |= [p.name in unscaled_parameters for p in problem.model.parameters]
    dependent = _bound_dependent(problem, best.x, variance, C, bound)
    minimum = _Neighbourhood(problem, best, variance, C, profiles)
    u: dict[str, float | None] = {}
    intervals: dict[str, tuple[float, float]] = {}
    undetermined = []
    for i, parameter in enumerate(problem.model.parameters):
        if only is not None and parameter.name not in only:
            continue
        u[parameter.name], ends = minimum.u_or_interval(i, bool(invalid[i]), bool(dependent[i]))
        if ends is None:
            continue
        intervals[parameter.name] = ends
        if parameter.name in unscaled_parameters or ends[1] - ends[0] > minimum.half_domain(i):
            undetermined.append(parameter.name)
    correlation = _correlation(C, [u.get(p.name) for p in problem.model.parameters])
    return Uncertainty(u, intervals, tuple(undetermined), correlation)


def unknown(problem: Problem) -> Uncertainty:
    """No uncertainty of any parameter."""
    names = [p.name for p in problem.model.parameters]
    correlation = np.full((len(names), len(names)), np.nan)
    return Uncertainty(dict.fromkeys(names), {}, (), correlation)


def _bound_dependent(
    problem: Problem, x: FloatArray, variance: float, C: FloatArray, bound: BoolArray
) -> BoolArray:
    """Parameters whose u would grow if those on a bound were free."""
    if not np.any(bound):
        return bound
    off = problem.off_flat_bounds(x, range(x.size))
    freed, invalid = _linearised(problem, off, variance, np.ones_like(bound))
    wider = np.diag(freed) > _AGREEMENT**2 * np.diag(C)
    return np.asarray(wider | invalid)


def _linearised(
    problem: Problem, x: FloatArray, variance: float, varied: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Linearised covariance (K, K) of the `varied` parameters, and a mask where it is invalid."""
    invalid = ~varied
    C = np.full((x.size, x.size), np.nan)
    free = np.flatnonzero(varied)
    if free.size == 0:
        return C, invalid
    J = problem.jacobian(x, free.tolist())
    norm = np.linalg.norm(J, axis=0)
    effective = norm * (problem.high - problem.low)[free] > _MIN_EFFECT * np.sqrt(variance)
    invalid[free[~effective]] = True
    free, J, norm = free[effective], J[:, effective], norm[effective]
    if free.size == 0:
        return C, invalid
    _, S, Vt = np.linalg.svd(J / norm, full_matrices=False)
    determined = _RANK * S[0] < S
    invalid[free] |= np.any(np.abs(Vt[~determined]) > 0.1, axis=0)
    root = Vt[determined].T / S[determined]
    C[np.ix_(free, free)] = variance * (root @ root.T) / np.outer(norm, norm)
    return C, invalid


@dataclass(frozen=True, slots=True)
class _Neighbourhood:
    """chi2 near a minimum, with the linearised covariance C (K, K) to compare it with."""

    problem: Problem
    best: Minimum
    variance: float
    C: FloatArray
    profiles: bool

    def half_domain(self, i: int) -> float:
        """Half of a parameter's domain."""
        return float(self.problem.high[i] - self.problem.low[i]) / 2

    def u_or_interval(
        self, i: int, invalid: bool, bound_dependent: bool
    ) -> tuple[float | None, tuple[float, float] | None]:
        """A parameter's u and None, or None and its interval."""
        u = None if invalid else float(np.sqrt(self.C[i, i]))
        if u is not None and 2 * np.sqrt(RISE_95) * u > self.half_domain(i):
            u = None
        if u is not None and not bound_dependent and self.is_parabola(i):
            return u, None
        ends = float(self.problem.low[i]), float(self.problem.high[i])
        if self.profiles:
            ends = interval(self.problem, self.best, i, RISE_95 * self.variance)
        return (u, None) if u is not None and self.agrees(i, u, ends) else (None, ends)

    def is_parabola(self, i: int) -> bool:
        """True if chi2 rises as expected 2 u away along the valley of the linearised fit."""
        step = 2 * np.nan_to_num(self.C[:, i]) / np.sqrt(self.C[i, i])  # fixed parameters: NaN
        expected = 4 * self.variance
        for x in (self.best.x - step, self.best.x + step):
            if np.any((x < self.problem.low) | (self.problem.high < x)):
                return False
            rise = self.problem.chi2(x) - self.best.chi2
            if not expected / _AGREEMENT**2 < rise < expected * _AGREEMENT**2:
                return False
        return True

    def agrees(self, i: int, u: float, ends: tuple[float, float]) -> bool:
        """True if the ends lie about 1.96 u away; a bound may cut off one of them."""
        expected = np.sqrt(RISE_95) * u
        inside = 0
        for end, bound in zip(ends, (self.problem.low[i], self.problem.high[i]), strict=True):
            distance = abs(end - self.best.x[i])
            if distance > expected * _AGREEMENT:
                return False
            if end != bound:
                inside += 1
                if distance < expected / _AGREEMENT:
                    return False
        return inside > 0


def _correlation(C: FloatArray, u: list[float | None]) -> FloatArray:
    scale = np.array([np.nan if value is None else value for value in u])
    return np.asarray(C / np.outer(scale, scale))
