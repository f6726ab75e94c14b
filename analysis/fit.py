"""Fit of one reflectance model to measurements: values, uncertainties and how well it agrees.

What to use when: `fit` for one model that you have chosen; `analysis.choice.choose` to find the
simplest model that explains the data.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from analysis.acceptance import Acceptance, Brdf
from analysis.averaging import Averaged, average
from analysis.covariance import Covariance, independent, shared
from analysis.measurements import Measurements
from analysis.models import MODELS, Model
from analysis.problem import Problem, Solution
from analysis.uncertainty import uncertainty
from instrument.errors import NotDetermined
from instrument.geometry import FloatArray, Geometry

# No camera tells more: smaller residuals, relative to the mean BRDF, are rounding of the search.
LEAST_NOISE = 1e-5
# A model whose chi2 is less probable than this does not explain the data.
UNLIKELY = 1e-3
UNSETTLED = "the averaging over lamp and lens did not settle"


@dataclass(frozen=True, slots=True)
class FitResult:
    """A model fitted to N points; mappings are by parameter name, in the parameters' units.

    values: best values. u: standard uncertainties, None where none holds; then `intervals` has
    the 95 % profile-likelihood interval. undetermined: parameters that may lie anywhere in more
    than half of their domain. correlation: (K, K), NaN for a parameter without u.
    predicted: (N,) in 1/sr. u_total: (N,) in 1/sr, of each point, estimated from the residuals
    where no u is stated. residuals: (N,), measured minus predicted, less the likeliest
    values of the errors that points share, in units of the part of u that they do not share.
    pulls: those likeliest values by name, in units of their own u: beyond 2 or 3 one is suspect.
    chi2, reduced_chi2: None where no u is stated (or nothing is left over to test).
    bic: chi2 + K ln N, or N ln(rss / N) + K ln N where no u is stated.
    rms_relative: rms residual over mean BRDF. averaged: whether the model was averaged over the
    rig's acceptance, which is done only where that matters.
    """

    model: str
    values: Mapping[str, float]
    u: Mapping[str, float | None]
    intervals: Mapping[str, tuple[float, float]]
    undetermined: tuple[str, ...]
    correlation: FloatArray
    predicted: FloatArray
    u_total: FloatArray
    residuals: FloatArray
    pulls: Mapping[str, float]
    chi2: float | None
    dof: int
    reduced_chi2: float | None
    bic: float
    rms_relative: float
    averaged: bool
    converged: bool
    message: str


def fit(
    model: Model,
    measurements: Measurements,
    acceptance: Acceptance | None = None,
    smooth: Brdf | None = None,
) -> FitResult:
    """Fit a model by generalised least squares; starting values are found, not asked for.

    A first fit with the independent uncertainties gives the curve around which the covariance of
    all stated uncertainties is made; `smooth` may give a better curve, as when models are
    compared (see `covariance.shared`). With an `acceptance` the model is averaged over it where
    that changes it by more than a third of a point's independent uncertainty.

    Where the model does not explain the data, its misfit counts as independent noise (Birge
    1932): else errors of the lamp's angle or of the tile would be stretched to far more than
    their u in its place. Raises `NotDetermined` when there are fewer points than parameters
    (without a stated u: no more points than parameters).
    """
    first = first_fit(model, measurements)
    return refined(first, measurements, acceptance, smooth or first.brdf)


@dataclass(frozen=True, slots=True)
class FirstFit:
    """A model fitted with the independent uncertainties alone, without averaging."""

    problem: Problem
    solution: Solution
    bic: float

    def brdf(self, geometry: Geometry) -> FloatArray:
        """The fitted model in any geometry, in 1/sr."""
        return self.problem.plain(self.solution.x, geometry)


def first_fit(model: Model, measurements: Measurements) -> FirstFit:
    """The deepest minimum with independent uncertainties. Raises `NotDetermined` as `fit` does."""
    _require_points(model, measurements)
    problem = Problem(model, measurements.geometry, measurements.brdf, independent(measurements))
    solution = problem.best()
    return FirstFit(problem, solution, _bic(measurements, problem, solution.x.size, solution.chi2))


def refined(
    first: FirstFit, measurements: Measurements, acceptance: Acceptance | None, smooth: Brdf
) -> FitResult:
    """The fit with all uncertainties shared as they are, and averaged where that matters."""
    covariance = first.problem.covariance
    if measurements.u_random is not None:
        covariance = shared(measurements, smooth, first.brdf)
    whole = _solved(first, measurements, acceptance, covariance)
    dof = measurements.size - first.solution.x.size
    if measurements.u_random is not None and probability(whole.solution.chi2, dof) < UNLIKELY:
        misfit = max(1.0, first.solution.chi2 / dof)
        wider = replace(covariance, variance=covariance.variance * misfit)
        whole = _solved(first, measurements, acceptance, wider)
    return _result(measurements, whole, covariance)


def stated_u(result: FitResult, measurements: Measurements) -> dict[str, float]:
    """Standard uncertainties of the determined parameters, from the stated u of the data alone.

    Linear, at the fitted values, without fitting again: to compare what parts of u cost. Raises
    `ValueError` where no u is stated.
    """
    model = MODELS[result.model]
    free = [i for i, p in enumerate(model.parameters) if result.u[p.name] is not None]

    def smooth(geometry: Geometry) -> FloatArray:
        return model.brdf(geometry, **result.values)

    covariance = shared(measurements, smooth)
    problem = Problem(model, measurements.geometry, measurements.brdf, covariance)
    J = problem.jacobian(np.array([result.values[p.name] for p in model.parameters]), free)
    u = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    return {model.parameters[i].name: float(value) for i, value in zip(free, u, strict=True)}


def _solved(
    first: FirstFit, m: Measurements, acceptance: Acceptance | None, covariance: Covariance
) -> Averaged:
    problem = replace(first.problem, covariance=covariance)
    solution = problem.solve(first.solution.x)
    if acceptance is None:
        return Averaged(problem, solution, False, True)
    u = covariance.u_independent * math.sqrt(_noise(m, problem, solution))
    return average(problem, solution, m, acceptance, u)


def probability(chi2: float, dof: int) -> float:
    """Of a chi2 as large as this or larger, if the model and all stated u are right."""
    return float(chdtrc(float(dof), chi2)) if dof else 1.0


def determined(model: Model, measurements: Measurements) -> bool:
    """Whether there are as many points as parameters (one more where no u is stated)."""
    return measurements.size >= _points_needed(model, measurements)


def _points_needed(model: Model, measurements: Measurements) -> int:
    return len(model.parameters) + (measurements.u_random is None)


def _require_points(model: Model, measurements: Measurements) -> None:
    if not determined(model, measurements):
        raise NotDetermined(
            f"{model.name} has {len(model.parameters)} parameters; {measurements.size} points do "
            f"not determine them; allowed: {_points_needed(model, measurements)} points or more"
            + (" where no u_brdf is stated" if measurements.u_random is None else "")
        )


def _bic(measurements: Measurements, problem: Problem, parameters: int, chi2: float) -> float:
    """Schwarz's criterion: chi2 + K ln N, or N ln(rss / N) + K ln N where no u is stated."""
    n = measurements.size
    if measurements.u_random is None:
        chi2 = n * math.log(max(chi2 / n, _floor(problem)))
    return chi2 + parameters * math.log(n)


def _floor(problem: Problem) -> float:
    """The least variance of a point, in 1/sr squared, that a fit may find."""
    return max((LEAST_NOISE * float(np.mean(np.abs(problem.brdf)))) ** 2, 1e-300)


def _noise(measurements: Measurements, problem: Problem, solution: Solution) -> float:
    """Variance of the whitened residuals: 1 where u is stated, else estimated from them."""
    if measurements.u_random is not None:
        return 1.0
    return max(solution.chi2 / (measurements.size - solution.x.size), _floor(problem))


def _result(measurements: Measurements, whole: Averaged, covariance: Covariance) -> FitResult:
    problem, x = whole.problem, whole.solution.x
    noise = _noise(measurements, problem, whole.solution)
    known = uncertainty(problem, whole.solution, noise)
    predicted = problem.predict(x)
    residual = measurements.brdf - predicted
    u_total = covariance.u_total * math.sqrt(noise)
    white = covariance.whiten(residual)
    pulls = covariance.pulls(residual)
    unshared = residual - covariance.common @ pulls
    chi2 = float(white @ white)
    dof = measurements.size - x.size
    stated = measurements.u_random is not None
    mean = float(np.mean(measurements.brdf))
    return FitResult(
        model=problem.model.name,
        values=dict(zip(known.u, map(float, x), strict=True)),
        u=known.u,
        intervals=known.intervals,
        undetermined=known.undetermined,
        correlation=known.correlation,
        predicted=predicted,
        u_total=u_total,
        residuals=unshared / (covariance.u_independent * math.sqrt(noise)),
        pulls=dict(zip(covariance.names, map(float, pulls), strict=False)),
        chi2=chi2 if stated else None,
        dof=dof,
        reduced_chi2=chi2 / dof if stated and dof else None,
        bic=_bic(measurements, problem, x.size, chi2),
        rms_relative=float(np.sqrt(np.mean(np.square(residual)))) / mean if mean else math.inf,
        averaged=whole.used,
        converged=whole.solution.converged and whole.settled,
        message=whole.solution.message if whole.settled else UNSETTLED,
    )
