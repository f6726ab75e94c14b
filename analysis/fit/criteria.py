"""Statistical criteria of a fit: probability of its chi2, BIC, AICc, and the noise of the data.

Where no u is stated, the variance of the noise is estimated from the residuals.
"""

from __future__ import annotations

import math

import numpy as np

from analysis.data.measurements import Measurements
from analysis.fit.search.levenberg_marquardt import Minimum, weights
from analysis.fit.search.problem import Problem
from instrument.geometry import FloatArray

# Below what any camera resolves: smaller residuals, relative to the mean BRDF, are rounding.
LEAST_NOISE = 1e-5
# Level of all tests of significance: less probable deviations are not taken for chance.
SIGNIFICANCE = 1e-3
# One of 10 000 normal residuals is larger, in units of u: a robust fit sets such points aside.
OUTLIER_U = 4.0


def probability(chi2: float, dof: int) -> float:
    """Probability of a chi2 at least this large if the model and all stated u are right.

    A sum of positive terms (Abramowitz and Stegun, 26.4.4 and 26.4.5): `scipy.special` has the
    function too, but importing it would cost every run a fifth of a second.
    """
    if dof <= 0 or chi2 <= 0:
        return 1.0
    if chi2 == math.inf:
        return 0.0
    half, odd = chi2 / 2, dof % 2
    powers = np.arange(1, dof // 2) + odd / 2
    first = odd / 2 * math.log(half) - half - math.lgamma(1 + odd / 2)
    logs = np.cumsum(np.concatenate([[first], np.log(half / powers)]))[: dof // 2]
    return min(float(np.sum(np.exp(logs))) + odd * math.erfc(math.sqrt(half)), 1.0)


def enough_chi2(m: Measurements, problem: Problem) -> float:
    """chi2 of a model that explains the data: its mean and 3 standard deviations more.

    Where no u is stated, that of rounding.
    """
    if m.u_random is None:
        return m.size * variance_floor(problem)
    dof = max(m.size - len(problem.model.parameters), 1)
    return dof + 3 * math.sqrt(2 * dof)


def reduced_chi2(problem: Problem, found: Minimum) -> float:
    """chi2 over the degrees of freedom, of which at least one is counted."""
    return found.chi2 / max(problem.brdf.size - found.x.size, 1)


def bic(m: Measurements, problem: Problem, found: Minimum) -> float:
    """Schwarz's criterion: -2 ln(likelihood) + K ln N, but for a constant of the measurements.

    -2 ln(likelihood) is chi2 + ln(det C / det C0), C0 the covariance of `u_random` alone, or
    N ln(rss / N) where no u is stated. C is linearised about the model's own curve, so that it
    differs between models: chi2 alone would favour the model with the larger C.
    """
    return _deviance(m, problem, found.chi2) + found.x.size * math.log(m.size)


def _deviance(m: Measurements, problem: Problem, chi2: float) -> float:
    """-2 ln(likelihood) but for a constant of the measurements."""
    if m.u_random is not None:
        independent = 2 * float(np.sum(np.log(m.u_random)))
        return chi2 + problem.covariance.log_determinant - independent
    rss = chi2 * float(np.mean(problem.covariance.variance))
    return m.size * math.log(max(rss / m.size, variance_floor(problem)))


def aicc(m: Measurements, problem: Problem, found: Minimum) -> float:
    """Akaike's criterion with Hurvich and Tsai's (1989) correction for few points."""
    k = found.x.size + (m.u_random is None)  # an estimated noise is one more parameter
    spare = m.size - k - 1
    penalty = 2 * k * m.size / spare if spare > 0 else math.inf
    return _deviance(m, problem, found.chi2) + penalty


def variance_floor(problem: Problem) -> float:
    """Least variance of a point, in 1/sr^2, that a fit may estimate."""
    return max((LEAST_NOISE * float(np.mean(np.abs(problem.brdf)))) ** 2, 1e-300)


def noise_variance(m: Measurements, problem: Problem, solution: Minimum) -> float:
    """Variance of the whitened residuals: 1 where u is stated, else estimated from them.

    It is also 1 where the problem's covariance holds errors that points share: beside these the
    noise is in u, stated or estimated before. That of a robust fit is larger, because large
    residuals have less weight.
    """
    spare = m.size - solution.x.size
    known = m.u_random is not None or problem.covariance.common.shape[1] > 0
    if problem.huber is not None and spare > 0:
        least = variance_floor(problem) / float(np.mean(problem.covariance.variance))
        found = problem.residual(solution.x)
        return max(_robust_variance(found, problem.huber, None if known else spare), least)
    if known:
        return 1.0
    return max(solution.chi2 / spare, variance_floor(problem))


def _robust_variance(r: FloatArray, limit: float, spare: int | None) -> float:
    """Mean of psi^2 over the squared mean of its derivative (Huber 1981, section 7.6).

    Estimated from the residuals with `spare` degrees of freedom. Where u is stated (None), taken
    from the normal distribution, mixed with the fraction of outliers among the residuals.
    """
    if spare is not None:
        psi2 = float(np.sum(np.square(r * weights(r, limit)))) / spare
        return psi2 / max(float(np.mean(np.abs(r) <= limit)), 0.5) ** 2
    outliers = float(np.mean(np.abs(r) > OUTLIER_U))
    inside = math.erf(limit / math.sqrt(2))
    density = math.exp(-(limit**2) / 2) / math.sqrt(2 * math.pi)
    psi2 = inside - 2 * limit * density + limit**2 * (1 - inside)
    weighted = (1 - outliers) * psi2 + outliers * limit**2
    return weighted / max((1 - outliers) * inside, 0.5) ** 2
