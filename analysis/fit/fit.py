"""Fit of one reflectance model to measurements: values, uncertainties and how well it agrees.

What to use when: `fit` for one model that you have chosen; `analysis.choice.choice.choose` to find
the simplest model that explains the data.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from analysis.data.acceptance import Acceptance
from analysis.data.covariance import Covariance, shared
from analysis.data.measurements import Measurements
from analysis.fit.acceptance_average import Averaged, average
from analysis.fit.criteria import NOT_NORMAL, UNLIKELY, aicc, bic, noise_variance, probability
from analysis.fit.first_fit import FirstFit, first_fit
from analysis.fit.problem import Problem
from analysis.fit.relative_scale import normalise_lamp_levels, relative, unscaled_parameters
from analysis.fit.uncertainty import uncertainty
from analysis.models import MODELS, Model
from analysis.models.base import Validity
from instrument.geometry import BoolArray, Brdf, FloatArray, Geometry

UNSETTLED = "the averaging over lamp and lens did not settle"


@dataclass(frozen=True, slots=True)
class FitResult:
    """A model fitted to N points; mappings are by parameter name, in the parameters' units.

    problem, x: what was solved, and the parameters (K,) in the model's order. values: the same by
    name. u: standard uncertainties, None where none holds; then `intervals` has the 95 %
    profile-likelihood interval. undetermined: parameters that may lie anywhere in more than half
    of their domain. correlation: (K, K), NaN for a parameter without u.
    predicted: (N,) in 1/sr. u_total: (N,) in 1/sr, of each point, estimated from the residuals
    where no u is stated. residuals: (N,), measured minus predicted, less the likeliest
    values of the errors that points share, in units of the part of u that they do not share.
    pulls: those likeliest values by name, in units of their own u: beyond 2 or 3 one is suspect.
    outliers: (N,), points that a robust fit set aside; they do not count in what follows.
    chi2, reduced_chi2: None where no u is stated (or nothing is left over to test).
    bic, aicc: chi2 + K ln N and chi2 + 2 K N / (N - K - 1), with N ln(rss / N) for chi2 where no u
    is stated. rms_relative: rms residual over mean BRDF. averaged: whether the model was averaged
    over the rig's acceptance, which is done only where that matters. message: why it stopped.
    """

    model: str
    problem: Problem
    x: FloatArray
    values: Mapping[str, float]
    u: Mapping[str, float | None]
    intervals: Mapping[str, tuple[float, float]]
    undetermined: tuple[str, ...]
    correlation: FloatArray
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
        """The fitted model in any geometry, in 1/sr, as it is without a rig's averaging."""
        return self.problem.plain(self.x, geometry)

    @property
    def validity(self) -> Validity:
        """Where the fitted model holds among the points (N,), and why it does not elsewhere."""
        values = dict(zip(self.u, map(float, self.x), strict=True))
        return self.problem.model.validity(self.problem.geometry, **values)


def fit(
    model: Model,
    measurements: Measurements,
    acceptance: Acceptance | None = None,
    smooth: Brdf | None = None,
    robust: bool = False,
) -> FitResult:
    """Fit a model by generalised least squares; starting values are found, not asked for.

    A first fit with the independent uncertainties gives the curve around which the covariance of
    all stated uncertainties is made; `smooth` may give a better curve, as when models are
    compared (see `covariance.shared`). With an `acceptance` the model is averaged over it where
    that changes it by more than a third of a point's independent uncertainty. `robust`: large
    residuals count linearly (Huber 1964), and those beyond 4 u are set aside and named.

    Where the model does not explain the data, its misfit counts as independent noise (Birge
    1932): else errors of the lamp's angle or of the tile would be stretched to far more than
    their u in its place. Raises `NotDetermined` when there are fewer points than parameters
    (without a stated u: no more points than parameters).
    """
    first = first_fit(model, measurements, robust)
    if measurements.free_levels:
        measurements = normalise_lamp_levels(measurements, first.brdf)
        first = first_fit(model, measurements, robust)
    return refined(first, measurements, acceptance, smooth or first.brdf)


def refined(
    first: FirstFit,
    measurements: Measurements,
    acceptance: Acceptance | None,
    smooth: Brdf,
    hopeless: bool = False,
) -> FitResult:
    """The fit with all uncertainties shared as they are, and averaged where that matters.

    A `hopeless` one, far off where another model is not, is neither averaged nor profiled: the
    interval of a parameter that has no u is then its whole domain.
    """
    if measurements.u_random is None:
        covariance = first.problem.covariance
        whole = _solved(first, measurements, None if hopeless else acceptance, covariance)
        return _result(measurements, whole, covariance, hopeless)
    covariance = shared(measurements, smooth, first.brdf)
    dof = max(measurements.size - first.solution.x.size, 1)
    wider = replace(covariance, variance=covariance.variance * max(1, first.solution.chi2 / dof))
    if hopeless:
        problem = replace(first.problem, covariance=wider)
        known = Averaged(problem, first.solution, False, True)
        return _result(measurements, known, covariance, True)
    whole = _solved(first, measurements, acceptance, covariance)
    if probability(whole.solution.chi2, dof) < UNLIKELY:
        whole = _solved(first, measurements, acceptance, wider)
    return _result(measurements, whole, covariance, False)


def stated_u(result: FitResult, measurements: Measurements) -> dict[str, float]:
    """Standard uncertainties of the determined parameters, from the stated u of the data alone.

    Linear, at the fitted values, without fitting again: to compare what parts of u cost. Raises
    `ValueError` where no u is stated.
    """
    model = MODELS[result.model]
    if measurements.relative:
        model = relative(model, measurements.brdf)
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
    # Without shared errors the first fit is the fit.
    same = covariance.common.shape[1] == 0 and np.array_equal(
        covariance.variance, first.problem.covariance.variance
    )
    solution = first.solution if same else problem.solve(first.solution.x)
    if acceptance is None:
        return Averaged(problem, solution, False, True)
    u = covariance.u_independent * math.sqrt(noise_variance(m, problem, solution))
    return average(problem, solution, m, acceptance, u)


def _result(m: Measurements, whole: Averaged, covariance: Covariance, hopeless: bool) -> FitResult:
    problem, found = replace(whole.problem, covariance=covariance), whole.solution
    x = found.x
    noise = noise_variance(m, whole.problem, found)
    free = unscaled_parameters(problem.model) if m.relative else frozenset[str]()
    known = uncertainty(whole.problem, found, noise, free, profiles=not hopeless)
    predicted = problem.predict(x)
    residual = m.brdf - predicted
    scale = math.sqrt(noise) if m.u_random is None and problem.huber is None else 1.0
    pulls = covariance.pulls(residual)
    unshared = (residual - covariance.common @ pulls) / (covariance.u_independent * scale)
    outliers = np.abs(unshared) > NOT_NORMAL if problem.huber else np.zeros(m.size, dtype=bool)
    good = ~outliers
    white = covariance.of(good).whiten(residual[good])
    chi2 = float(white @ white)
    dof = int(np.sum(good)) - x.size
    stated = m.u_random is not None
    mean = float(np.mean(m.brdf[good]))
    rms = float(np.sqrt(np.mean(np.square(residual[good]))))
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
        averaged=whole.used,
        converged=found.converged and whole.settled,
        message=found.message if whole.settled else UNSETTLED,
    )
