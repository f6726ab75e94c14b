"""Fit of one reflectance model to measurements: values, uncertainties and agreement.

Use `fit` for one model of your choice, and `analysis.choice.choice.choose` to find the simplest
model that explains the data.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, NamedTuple

import numpy as np

from analysis.data.acceptance import Acceptance
from analysis.data.covariance import Covariance, full_covariance, has_shared_errors
from analysis.data.measurements import Measurements
from analysis.fit.acceptance_average import AveragedFit, fit_averaged, is_averaged
from analysis.fit.criteria import (
    OUTLIER_U,
    SIGNIFICANCE,
    aicc,
    bic,
    enough_chi2,
    noise_variance,
    probability,
    reduced_chi2,
)
from analysis.fit.first_fit import FirstFit, FirstFits, huber_refit
from analysis.fit.relative_scale import normalise_lamp_levels, unscaled_parameters
from analysis.fit.scale_ratios import Ratio, scale_ratios
from analysis.fit.search.levenberg_marquardt import Minimum, loss
from analysis.fit.search.minima import all_minima, deepest
from analysis.fit.search.problem import Problem
from analysis.fit.uncertainty import Uncertainty, uncertainty, unknown
from analysis.models import Model
from analysis.models.base import Validity
from instrument.geometry import BoolArray, FloatArray, Geometry

# Rounds in which misfit is turned into noise, until chi2 is within this factor of its expectation.
_ROUNDS_OF_WIDENING, _WIDE_ENOUGH = 8, 1.1

# Minima of the first fit from which the search with all uncertainties starts, and the relative
# tolerance of its first steps.
_CONTENDERS, _QUICK_RTOL = 4, 1e-2

# Reduced chi2 beyond which a model is so far from the data that intervals would say nothing.
_FAR_CHI2 = 25.0

# Relative u of a shared error that may move the first fit, which does not know it, so far that the
# covariance has to be linearised around a second one before a model is found to be far.
_LARGE_SHARED = 0.01

OfParameters = Literal["profiled", "none"]
"""Uncertainty of a fit's parameters: with the intervals of those that have no u, or none yet."""

NOT_CONVERGED = "the averaging over lamp, lens and a turning axis did not converge"


@dataclass(frozen=True, slots=True)
class FitResult:
    """A model fitted to N points; mappings are by parameter name, in the parameters' units.

    problem: with the stated uncertainties. solved: the same, with the misfit as noise where the
    model does not explain the data. x: the minimum of `solved`, (K,) in the model's order. values:
    the same by name. u: standard uncertainties, None where none is valid; `intervals` then has the
    95 % profile-likelihood interval. undetermined: parameters whose interval is more than half of
    their domain. correlation: (K, K), NaN for a parameter without u. ratios:
    those of the model's scales that the data determine, by name such as "ks/albedo".
    predicted: (N,) in 1/sr. u_total: (N,) in 1/sr, of each point; estimated from the residuals
    where no u is stated. residuals: (N,), measured minus predicted, less the most likely values of
    the errors that points share, in units of the independent part of u. pulls: those most likely
    values by name, in units of their own u: above 2 or 3 one is suspect.
    outliers: (N,), points that a robust fit set aside, fewer than half; they do not count in what
    follows.
    chi2, reduced_chi2: None where no u is stated; reduced_chi2 also without degrees of freedom.
    bic, aicc: -2 ln(likelihood) + K ln N, and + 2 K N / (N - K - 1): see `criteria.bic`.
    rms_relative: rms residual over mean BRDF; where no u is stated, less shared errors.
    averaged: the model was averaged over the rig's acceptance and the turn of an axis, which is
        done where that matters.
    message: why the search ended.
    """

    model: str
    problem: Problem
    solved: Problem
    x: FloatArray
    values: Mapping[str, float]
    u: Mapping[str, float | None]
    intervals: Mapping[str, tuple[float, float]]
    undetermined: tuple[str, ...]
    correlation: FloatArray
    ratios: Mapping[str, Ratio]
    predicted: FloatArray
    u_total: FloatArray
    residuals: FloatArray
    pulls: Mapping[str, float]
    outliers: BoolArray
    chi2: float | None
    dof: int
    reduced_chi2: float | None
    bic: float
    aicc: float
    rms_relative: float
    averaged: bool
    converged: bool
    message: str

    def brdf(self, geometry: Geometry) -> FloatArray:
        """BRDF of the fitted model in 1/sr, of the geometry's shape, not averaged over the rig."""
        return self.problem.model_brdf(self.x, geometry)

    @property
    def validity(self) -> Validity:
        """Points (N,) at which the model's formula is valid, and why it is not at the others."""
        values = dict(zip(self.u, map(float, self.x), strict=True))
        return self.problem.model.validity(self.problem.geometry, **values)


def fit(
    model: Model,
    measurements: Measurements,
    acceptance: Acceptance | None = None,
    robust: bool = False,
) -> FitResult:
    """Fit a model by generalised least squares; starting values are found automatically.

    A first fit with the independent uncertainties gives the curve around which the covariance of
    all stated uncertainties is linearised (`covariance.full_covariance`). With an `acceptance`, or
    where theta_r turned, the model is averaged over it if that changes it by more than a third of a
    point's independent uncertainty. `robust`: large residuals count linearly (Huber 1964), and
    those beyond 4 u are set aside and reported.

    Where the model does not explain the data, its misfit counts as independent noise (Birge 1932);
    otherwise shared errors, such as that of the lamp's angle or of the tile, would have to absorb
    it with values far beyond their u. Raises `NotDetermined` when there are fewer points than
    parameters (without a stated u: no more points than parameters).
    """
    return refine(FirstFits(measurements).of(model), measurements, acceptance, robust)


def refine(
    first: FirstFit,
    measurements: Measurements,
    acceptance: Acceptance | None,
    robust: bool = False,
    u: OfParameters = "profiled",
) -> FitResult:
    """Refit with all uncertainties, shared ones included, and averaged where that matters.

    `first` is the model's fit to the measurements with independent uncertainties. The result is
    that of `fit`, whatever other models are compared: averaging is left out where it hardly matters
    beside the model's own misfit. `u`: of the parameters; for a model far from the data, the
    interval of one without u is its whole domain. A rough fit stays as it is, without u.
    """
    m = measurements
    if first.rough:
        return _rough_result(first, m)
    if m.free_levels:
        m = normalise_lamp_levels(m, first.brdf)
        first = FirstFits(m).of(first.model)
    if robust:
        first = huber_refit(first, m)
    linear = _Linearised(first.problem, first.solution, first.starts)
    if has_shared_errors(m):
        linear = _linearised(first, _with_noise(first, m))
    fitted = _averaged(linear, m, acceptance)
    if m.u_random is not None and _rejected(fitted):
        fitted = _widened(linear, fitted, m, acceptance)
    return _result(m, fitted, linear.problem.covariance, u)


def _rough_result(first: FirstFit, m: Measurements) -> FitResult:
    """The result of a fit that is not followed, with the chi2 that it has as shared errors are."""
    problem = first.problem
    if has_shared_errors(m):
        stated = _with_noise(first, m)
        problem = replace(problem, covariance=full_covariance(stated, first.brdf))
    as_it_is = AveragedFit(problem, first.solution, averaged=False, converged=True)
    return _result(m, as_it_is, problem.covariance, "none")


def with_linear_u(result: FitResult, m: Measurements) -> FitResult:
    """The result, made without u, with that of its parameters where it is valid, no intervals."""
    problem = result.solved
    found = Minimum(result.x, problem.chi2(result.x), result.converged, result.message)
    noise = noise_variance(m, problem, found)
    known, ratios = _known(m, problem, found, noise, profiles=False)
    ratios = {name: ratio for name, ratio in ratios.items() if ratio.u is not None}
    return replace(result, u=known.u, correlation=known.correlation, ratios=ratios)


class _Linearised(NamedTuple):
    """A fit with all uncertainties, without averaging; `others` (K,) are further minima."""

    problem: Problem
    solution: Minimum
    others: tuple[FloatArray, ...] = ()


def _linearised(first: FirstFit, m: Measurements) -> _Linearised:
    """Fit with the covariance linearised around the model's own curve, in two rounds.

    A shared error may hide which minimum is the deepest: the first round searches again from the
    lowest ones.
    """
    problem = replace(first.problem, covariance=full_covariance(m, first.brdf))
    lowest = sorted(first.starts, key=problem.chi2)[:_CONTENDERS]
    quick = min((problem.solve(x, rtol=_QUICK_RTOL) for x in lowest), key=lambda one: one.chi2)
    if reduced_chi2(problem, quick) > _FAR_CHI2 and _largest_shared(m) > _LARGE_SHARED:
        around = full_covariance(m, partial(problem.model_brdf, quick.x))
        problem = replace(problem, covariance=around)
        quick = problem.solve(quick.x, rtol=_QUICK_RTOL)
    if reduced_chi2(problem, quick) > _FAR_CHI2:
        return _Linearised(problem, quick, tuple(lowest))
    found = all_minima(problem, [quick.x, *lowest], enough_chi2(m, problem))
    covariance = full_covariance(m, partial(problem.model_brdf, found[0].x))
    problem = replace(problem, covariance=covariance)
    others = tuple(other.x for other in found[1:])
    return _Linearised(problem, deepest(problem, found[0].x, others), others)


def _largest_shared(m: Measurements) -> float:
    return max((float(np.max(np.abs(e.u_relative), initial=0.0)) for e in m.shared), default=0.0)


def _rejected(fitted: AveragedFit) -> bool:
    return probability(*_misfit(fitted)) < SIGNIFICANCE


def _misfit(fitted: AveragedFit) -> tuple[float, int]:
    """chi2 and its degrees of freedom, at least one, without the outliers of a robust fit.

    Counted, they would pass for noise of all points, and beside it no longer be outliers.
    """
    problem, found = fitted.problem, fitted.solution
    if problem.huber is None:
        return found.chi2, max(problem.brdf.size - found.x.size, 1)
    residual = problem.residual(found.x)
    good = residual[~_outliers(residual)]
    return float(good @ good), max(good.size - found.x.size, 1)


def _widened(
    linear: _Linearised, fitted: AveragedFit, m: Measurements, acceptance: Acceptance | None
) -> AveragedFit:
    """Refit with the misfit as independent noise: its variance grows until chi2 is as expected."""
    stated = linear.problem.covariance
    averaged = is_averaged(m, acceptance)
    if not averaged and linear.problem.huber is None and not stated.common.shape[1]:
        return _with_less_weight(linear)
    factor = 1.0
    for _ in range(_ROUNDS_OF_WIDENING):
        chi2, dof = _misfit(fitted)
        factor *= max(1.0, chi2 / dof)
        problem = replace(
            linear.problem, covariance=replace(stated, variance=stated.variance * factor)
        )
        found = problem.solve(linear.solution.x)
        fitted = _averaged(_Linearised(problem, found, linear.others), m, acceptance)
        chi2, dof = _misfit(fitted)
        if chi2 < _WIDE_ENOUGH * dof:
            break
    return fitted


def _with_less_weight(linear: _Linearised) -> AveragedFit:
    """The fit with the misfit as noise where all errors are independent: its minimum stays."""
    problem, found, _ = linear
    factor = reduced_chi2(problem, found)
    wider = replace(problem.covariance, variance=problem.covariance.variance * factor)
    found = found._replace(chi2=found.chi2 / factor)
    return AveragedFit(replace(problem, covariance=wider), found, averaged=False, converged=True)


def _with_noise(first: FirstFit, m: Measurements) -> Measurements:
    """Measurements with u_random: as stated, or estimated from the first fit."""
    if m.u_random is not None:
        return m
    noise = noise_variance(m, first.problem, first.solution)
    return replace(m, u_random=np.sqrt(first.problem.covariance.variance * noise))


def stated_u(result: FitResult, measurements: Measurements) -> dict[str, float]:
    """Standard uncertainties of the determined parameters, from the stated u of the data alone.

    Linearised at the fitted values, without a new fit: to compare the contributions to u. Raises
    `ValueError` where no u is stated.
    """
    names = list(result.u)
    free = [i for i, name in enumerate(names) if result.u[name] is not None]
    if not free:
        return {}
    covariance = full_covariance(measurements, result.brdf)
    problem = Problem(result.problem.model, measurements.geometry, measurements.brdf, covariance)
    J = problem.jacobian(result.x, free)
    u = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    return {names[i]: float(value) for i, value in zip(free, u, strict=True)}


def _averaged(linear: _Linearised, m: Measurements, acceptance: Acceptance | None) -> AveragedFit:
    problem, solution, others = linear
    if not is_averaged(m, acceptance):
        return AveragedFit(problem, solution, averaged=False, converged=True)
    u = problem.covariance.u_independent * math.sqrt(noise_variance(m, problem, solution))
    return fit_averaged(problem, solution, m, acceptance, u, others)


def _result(
    m: Measurements,
    fitted: AveragedFit,
    covariance: Covariance,
    u: OfParameters,
) -> FitResult:
    """Result with chi2 and u_total by the stated `covariance`, and u with the misfit as noise."""
    problem, found = replace(fitted.problem, covariance=covariance), fitted.solution
    x = found.x
    noise = noise_variance(m, fitted.problem, found)
    predicted = problem.predict(x)
    residual = m.brdf - predicted
    found = found._replace(chi2=loss(covariance.whiten(residual), problem.huber))
    near = m.u_random is None or reduced_chi2(problem, found) < _FAR_CHI2
    known, ratios = unknown(problem), dict[str, Ratio]()
    if u == "profiled":
        known, ratios = _known(m, fitted.problem, fitted.solution, noise, profiles=near)
    scale = math.sqrt(noise) if m.u_random is None and problem.huber is None else 1.0
    pulls = covariance.pulls(residual)
    own = residual - covariance.common @ pulls
    unshared = own / (covariance.u_independent * scale)
    outliers = _outliers(unshared) if problem.huber else np.zeros(m.size, dtype=bool)
    good = ~outliers
    kept = covariance.subset(good) if np.any(outliers) else covariance
    white = kept.whiten(residual[good])
    chi2 = float(white @ white)
    dof = int(np.sum(good)) - x.size
    stated = m.u_random is not None
    mean = float(np.mean(m.brdf[good]))
    rms = float(np.sqrt(np.mean(np.square((residual if stated else own)[good]))))
    return FitResult(
        model=problem.model.name,
        problem=problem,
        solved=fitted.problem,
        x=x,
        values=dict(zip(known.u, map(float, x), strict=True)),
        u=known.u,
        intervals=known.intervals,
        undetermined=known.undetermined if near else (),
        correlation=known.correlation,
        ratios=ratios,
        predicted=predicted,
        u_total=covariance.u_total * scale,
        residuals=unshared,
        pulls=dict(zip(covariance.names, map(float, pulls), strict=False)),
        outliers=outliers,
        chi2=chi2 if stated else None,
        dof=dof,
        reduced_chi2=chi2 / dof if stated and dof > 0 else None,
        bic=bic(m, problem, found),
        aicc=aicc(m, problem, found),
        rms_relative=rms / mean if mean else math.inf,
        averaged=fitted.averaged,
        converged=found.converged and fitted.converged,
        message=found.message if fitted.converged else NOT_CONVERGED,
    )


def _known(
    m: Measurements, problem: Problem, found: Minimum, noise: float, *, profiles: bool
) -> tuple[Uncertainty, dict[str, Ratio]]:
    """Uncertainties of the parameters and of the ratios of scales."""
    unscaled = unscaled_parameters(problem.model) if m.relative else frozenset[str]()
    ratios = scale_ratios(problem, found, noise, profiles=profiles)
    return uncertainty(problem, found, noise, unscaled, profiles), ratios


def _outliers(residuals: FloatArray) -> BoolArray:
    """Mask (N,) of residuals, in units of u, to set aside; a majority is a misfit of the model."""
    found = np.abs(residuals) > OUTLIER_U
    return found & (2 * np.count_nonzero(found) < found.size)
