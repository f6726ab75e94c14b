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
from analysis.descent import HUBER, Minimum, weights
from analysis.measurements import Measurements
from analysis.models import MODELS, Model
from analysis.models.base import BoolArray
from analysis.problem import Problem
from analysis.relative import NAME as RELATIVE_FACTOR
from analysis.relative import levelled, relative, untied
from analysis.starts import starts
from analysis.uncertainty import uncertainty
from instrument.errors import NotDetermined
from instrument.geometry import FloatArray, Geometry

# No camera tells more: smaller residuals, relative to the mean BRDF, are rounding of the search.
LEAST_NOISE = 1e-5
# A model whose chi2 is less probable than this does not explain the data.
UNLIKELY = 1e-3
UNSETTLED = "the averaging over lamp and lens did not settle"

# Starts that are tried where the first one's minimum does not explain the data.
_MOST_STARTS = 3
# Rounds in which a robust fit and its estimate of the noise settle.
_ROBUST_ROUNDS = 3
# A robust fit sets residuals beyond this many u aside: of 10 000 good ones, one is.
_OUTLIER = 4.0
# Of normal errors, standard deviation over median of the absolute value.
_PER_MEDIAN = 1.4826


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
        measurements = levelled(measurements, first.brdf)
        first = first_fit(model, measurements, robust)
    return refined(first, measurements, acceptance, smooth or first.brdf)


@dataclass(frozen=True, slots=True)
class FirstFit:
    """A model fitted with the independent uncertainties alone, without averaging."""

    problem: Problem
    solution: Minimum
    bic: float

    def brdf(self, geometry: Geometry) -> FloatArray:
        """The fitted model in any geometry, in 1/sr."""
        return self.problem.plain(self.solution.x, geometry)


def first_fit(model: Model, measurements: Measurements, robust: bool = False) -> FirstFit:
    """The deepest minimum with independent uncertainties. Raises `NotDetermined` as `fit` does.

    Where measurements are relative, the model has one more parameter: see `analysis.relative`.
    """
    if measurements.relative:
        model = relative(model, measurements.brdf)
    _require_points(model, measurements)
    problem = Problem(model, measurements.geometry, measurements.brdf, independent(measurements))
    solution = _deepest(problem, measurements)
    if robust:
        problem, solution = _made_robust(problem, solution, measurements)
    return FirstFit(problem, solution, _bic(measurements, problem, solution))


def _deepest(problem: Problem, m: Measurements) -> Minimum:
    """The minimum from the best start; where it explains too little, of other basins too."""
    first, *others = starts(problem, _MOST_STARTS)
    best = problem.solve(first)
    for start in others:
        if _explained(problem, best, m):
            break
        best = min(best, problem.solve(start), key=lambda found: (not found.converged, found.chi2))
    return best


def _explained(problem: Problem, found: Minimum, m: Measurements) -> bool:
    if m.u_random is None:
        return found.converged and found.chi2 <= m.size * _floor(problem)
    return found.converged and probability(found.chi2, m.size - found.x.size) > UNLIKELY


def _made_robust(problem: Problem, solution: Minimum, m: Measurements) -> tuple[Problem, Minimum]:
    """The fit with Huber's loss; where no u is stated, the residuals' median gives the noise."""
    problem = replace(problem, huber=HUBER)
    for _ in range(_ROBUST_ROUNDS if m.u_random is None else 1):
        if m.u_random is None:
            left = np.abs(problem.predict(solution.x) - problem.brdf)
            variance = max((_PER_MEDIAN * float(np.median(left))) ** 2, _floor(problem))
            problem = replace(
                problem, covariance=replace(problem.covariance, variance=np.full(m.size, variance))
            )
        solution = problem.solve(solution.x)
    return problem, solution


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
    u = covariance.u_independent * math.sqrt(_noise(m, problem, solution))
    return average(problem, solution, m, acceptance, u)


def probability(chi2: float, dof: int) -> float:
    """Of a chi2 as large as this or larger, if the model and all stated u are right."""
    return float(chdtrc(float(dof), chi2)) if dof > 0 else 1.0


def determined(model: Model, measurements: Measurements) -> bool:
    """Whether there are as many points as parameters (one more where no u is stated)."""
    return measurements.size >= _points_needed(model, measurements)


def _points_needed(model: Model, m: Measurements) -> int:
    named = any(p.name == RELATIVE_FACTOR for p in model.parameters)
    return len(model.parameters) + (m.u_random is None) + (m.relative and not named)


def _require_points(model: Model, measurements: Measurements) -> None:
    if not determined(model, measurements):
        raise NotDetermined(
            f"{model.name} has {len(model.parameters)} parameters; {measurements.size} points do "
            f"not determine them; allowed: {_points_needed(model, measurements)} points or more"
            + (" where no u_brdf is stated" if measurements.u_random is None else "")
        )


def _bic(m: Measurements, problem: Problem, found: Minimum) -> float:
    """Schwarz's criterion: chi2 + K ln N, or N ln(rss / N) + K ln N where no u is stated."""
    return _deviance(m, problem, found.chi2) + found.x.size * math.log(m.size)


def _deviance(m: Measurements, problem: Problem, chi2: float) -> float:
    """-2 ln of the likelihood but for a constant: chi2, or N ln(rss / N) where no u is stated."""
    if m.u_random is not None:
        return chi2
    rss = chi2 * float(np.mean(problem.covariance.variance))
    return m.size * math.log(max(rss / m.size, _floor(problem)))


def _aicc(m: Measurements, problem: Problem, found: Minimum) -> float:
    """Akaike's criterion with Hurvich and Tsai's (1989) term for few points."""
    k = found.x.size + (m.u_random is None)  # the noise is a parameter too where it is estimated
    spare = m.size - k - 1
    penalty = 2 * k * m.size / spare if spare > 0 else math.inf
    return _deviance(m, problem, found.chi2) + penalty


def _floor(problem: Problem) -> float:
    """The least variance of a point, in 1/sr squared, that a fit may find."""
    return max((LEAST_NOISE * float(np.mean(np.abs(problem.brdf)))) ** 2, 1e-300)


def _noise(m: Measurements, problem: Problem, solution: Minimum) -> float:
    """Variance of the whitened residuals: 1 where u is stated, else estimated from them.

    A robust fit's is Huber's (1981, section 7.6): what counting large residuals less costs.
    """
    spare = m.size - solution.x.size
    if problem.huber is not None and spare > 0:
        r = problem.residual(solution.x)
        inside = float(np.mean(np.abs(r) <= problem.huber))
        psi2 = float(np.sum(np.square(r * weights(r, problem.huber)))) / spare
        return psi2 / max(inside, 0.5) ** 2
    if m.u_random is not None:
        return 1.0
    return max(solution.chi2 / spare, _floor(problem))


def _result(m: Measurements, whole: Averaged, covariance: Covariance) -> FitResult:
    problem, found = replace(whole.problem, covariance=covariance), whole.solution
    x = found.x
    noise = _noise(m, whole.problem, found)
    known = uncertainty(whole.problem, found, noise, untied(problem.model) if m.relative else ())
    predicted = problem.predict(x)
    residual = m.brdf - predicted
    scale = math.sqrt(noise) if m.u_random is None and problem.huber is None else 1.0
    pulls = covariance.pulls(residual)
    unshared = (residual - covariance.common @ pulls) / (covariance.u_independent * scale)
    outliers = np.abs(unshared) > _OUTLIER if problem.huber else np.zeros(m.size, dtype=bool)
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
        bic=_bic(m, problem, found),
        aicc=_aicc(m, problem, found),
        rms_relative=rms / mean if mean else math.inf,
        averaged=whole.used,
        converged=found.converged and whole.settled,
        message=found.message if whole.settled else UNSETTLED,
    )
