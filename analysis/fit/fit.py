"""Fit of one reflectance model to measurements: values, uncertainties and agreement.

Use `fit` for one model of your choice, and `analysis.choice.choice.choose` to find the simplest
model that explains the data.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from analysis.data.acceptance import Acceptance
from analysis.data.covariance import Covariance, full_covariance
from analysis.data.measurements import Measurements
from analysis.fit.acceptance_average import AveragedFit, fit_averaged
from analysis.fit.criteria import OUTLIER_U, SIGNIFICANCE, aicc, bic, noise_variance, probability
from analysis.fit.first_fit import FirstFit, first_fit
from analysis.fit.problem import Problem
from analysis.fit.relative_scale import normalise_lamp_levels, unscaled_parameters
from analysis.fit.scale_ratios import Ratio, scale_ratios
from analysis.fit.uncertainty import uncertainty
from analysis.models import Model
from analysis.models.base import Validity
from instrument.geometry import BoolArray, Brdf, FloatArray, Geometry

NOT_CONVERGED = "the averaging over lamp and lens did not converge"


@dataclass(frozen=True, slots=True)
class FitResult:
    """A model fitted to N points; mappings are by parameter name, in the parameters' units.

    problem, x: the problem solved, and the parameters (K,) in the model's order. values: the same
    by name. u: standard uncertainties, None where none is valid; `intervals` then has the 95 %
    profile-likelihood interval. undetermined: parameters whose interval is more than half of their
    domain. correlation: (K, K), NaN for a parameter without u. ratios: those of the model's scales
    that the data determine, by name such as "ks/albedo".
    predicted: (N,) in 1/sr. u_total: (N,) in 1/sr, of each point; estimated from the residuals
    where no u is stated. residuals: (N,), measured minus predicted, less the most likely values of
    the errors that points share, in units of the independent part of u. pulls: those most likely
    values by name, in units of their own u: above 2 or 3 one is suspect.
    outliers: (N,), points that a robust fit set aside, fewer than half; they do not count in what
    follows.
    chi2, reduced_chi2: None where no u is stated; reduced_chi2 also without degrees of freedom.
    bic, aicc: chi2 + K ln N and chi2 + 2 K N / (N - K - 1), with N ln(rss / N) for chi2 where no u
    is stated. rms_relative: rms residual over mean BRDF; where no u is stated, less shared errors.
    averaged: the model was averaged over the rig's acceptance, which is done where that matters.
    message: why the search ended.
    """

    model: str
    problem: Problem
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
    smooth: Brdf | None = None,
    robust: bool = False,
) -> FitResult:
    """Fit a model by generalised least squares; starting values are found automatically.

    A first fit with the independent uncertainties gives the curve around which the covariance of
    all stated uncertainties is linearised; `smooth` (BRDF in 1/sr, of the geometry's shape) may
    give a better one, as when models are compared (see `covariance.full_covariance`). With an
    `acceptance` the model is averaged over it where that changes it by more than a third of a
    point's independent uncertainty. `robust`: large residuals count linearly (Huber 1964), and
    those beyond 4 u are set aside and reported.

    Where the model does not explain the data, its misfit counts as independent noise (Birge 1932);
    otherwise shared errors, such as that of the lamp's angle or of the tile, would have to absorb
    it with values far beyond their u. Raises `NotDetermined` when there are fewer points than
    parameters (without a stated u: no more points than parameters).
    """
    first = first_fit(model, measurements, robust)
    if measurements.free_levels:
        measurements = normalise_lamp_levels(measurements, first.brdf)
        first = first_fit(model, measurements, robust)
    return refine(first, measurements, acceptance, smooth or first.brdf)


def refine(
    first: FirstFit,
    measurements: Measurements,
    acceptance: Acceptance | None,
    smooth: Brdf,
    ruled_out: bool = False,
    profiles: bool = True,
) -> FitResult:
    """Refit with all uncertainties, shared ones included, and averaged where that matters.

    `smooth` is a BRDF near the data, in 1/sr and of the geometry's shape. A `ruled_out` model, far
    worse than another, is neither averaged nor profiled. Without `profiles` the interval of a
    parameter without u is its whole domain.
    """
    if measurements.u_random is None:
        covariance = _estimated_covariance(first, measurements, ruled_out)
        found = _solve(first, measurements, None if ruled_out else acceptance, covariance)
        return _result(measurements, found, covariance, profiles and not ruled_out)
    covariance = full_covariance(measurements, smooth, first.brdf)
    dof = max(measurements.size - first.solution.x.size, 1)
    wider = replace(covariance, variance=covariance.variance * max(1, first.solution.chi2 / dof))
    if ruled_out:
        problem = replace(first.problem, covariance=wider)
        unchanged = AveragedFit(problem, first.solution, averaged=False, converged=True)
        return _result(measurements, unchanged, covariance, False)
    found = _solve(first, measurements, acceptance, covariance)
    if probability(found.solution.chi2, dof) < SIGNIFICANCE:
        found = _solve(first, measurements, acceptance, wider)
    return _result(measurements, found, covariance, profiles)


def _estimated_covariance(first: FirstFit, m: Measurements, ruled_out: bool) -> Covariance:
    """Covariance where no u is stated: 1, or estimated noise beside errors that points share."""
    known = first.problem.covariance
    if ruled_out or not (m.shared or m.free_levels):
        return known
    noise = noise_variance(m, first.problem, first.solution)
    stated = replace(m, u_random=np.sqrt(known.variance * noise))
    return full_covariance(stated, first.brdf)


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


def _solve(
    first: FirstFit, m: Measurements, acceptance: Acceptance | None, covariance: Covariance
) -> AveragedFit:
    problem = replace(first.problem, covariance=covariance)
    # Without shared errors the first fit is the fit.
    same = covariance.common.shape[1] == 0 and np.array_equal(
        covariance.variance, first.problem.covariance.variance
    )
    solution = first.solution if same else problem.solve(first.solution.x)
    if acceptance is None:
        return AveragedFit(problem, solution, averaged=False, converged=True)
    u = covariance.u_independent * math.sqrt(noise_variance(m, problem, solution))
    return fit_averaged(problem, solution, m, acceptance, u)


def _result(
    m: Measurements, fitted: AveragedFit, covariance: Covariance, profiles: bool
) -> FitResult:
    problem, found = replace(fitted.problem, covariance=covariance), fitted.solution
    x = found.x
    noise = noise_variance(m, fitted.problem, found)
    unscaled = unscaled_parameters(problem.model) if m.relative else frozenset[str]()
    known = uncertainty(fitted.problem, found, noise, unscaled, profiles)
    ratios = scale_ratios(fitted.problem, found, noise, profiles)
    predicted = problem.predict(x)
    residual = m.brdf - predicted
    scale = math.sqrt(noise) if m.u_random is None and problem.huber is None else 1.0
    pulls = covariance.pulls(residual)
    own = residual - covariance.common @ pulls
    unshared = own / (covariance.u_independent * scale)
    outliers = _outliers(unshared) if problem.huber else np.zeros(m.size, dtype=bool)
    good = ~outliers
    white = covariance.subset(good).whiten(residual[good])
    chi2 = float(white @ white)
    dof = int(np.sum(good)) - x.size
    stated = m.u_random is not None
    mean = float(np.mean(m.brdf[good]))
    rms = float(np.sqrt(np.mean(np.square((residual if stated else own)[good]))))
    found = found._replace(chi2=problem.chi2(x))
    return FitResult(
        model=problem.model.name,
        problem=problem,
        x=x,
        values=dict(zip(known.u, map(float, x), strict=True)),
        u=known.u,
        intervals=known.intervals,
        undetermined=known.undetermined,
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


def _outliers(residuals: FloatArray) -> BoolArray:
    """Mask (N,) of residuals, in units of u, to set aside; a majority is a misfit of the model."""
    found = np.abs(residuals) > OUTLIER_U
    return found & (2 * np.count_nonzero(found) < found.size)
