"""How likely a fit is: chi2's probability, the criteria of Schwarz and Akaike, the noise.

Where no u is stated, the noise is one more thing that the residuals have to tell.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import chdtrc

from analysis.data.measurements import Measurements
from analysis.fit.levenberg_marquardt import Minimum, weights
from analysis.fit.problem import Problem
from instrument.geometry import FloatArray

# No camera tells more: smaller residuals, relative to the mean BRDF, are rounding of the search.
LEAST_NOISE = 1e-5
# A model whose chi2 is less probable than this does not explain the data.
UNLIKELY = 1e-3
# Of 10 000 normal residuals one is beyond so many u: a robust fit sets such points aside.
NOT_NORMAL = 4.0


def probability(chi2: float, dof: int) -> float:
    """Of a chi2 as large as this or larger, if the model and all stated u are right."""
    return float(chdtrc(float(dof), chi2)) if dof > 0 else 1.0


def explained(problem: Problem, found: Minimum, m: Measurements) -> bool:
    """Whether a fit leaves nothing to explain: no more than the stated u, or than rounding."""
    if m.u_random is None:
        return found.converged and found.chi2 <= m.size * floor(problem)
    return found.converged and probability(found.chi2, m.size - found.x.size) > UNLIKELY


def bic(m: Measurements, problem: Problem, found: Minimum) -> float:
    """Schwarz's criterion: chi2 + K ln N, or N ln(rss / N) + K ln N where no u is stated."""
    return _deviance(m, problem, found.chi2) + found.x.size * math.log(m.size)


def _deviance(m: Measurements, problem: Problem, chi2: float) -> float:
    """-2 ln of the likelihood but for a constant: chi2, or N ln(rss / N) where no u is stated."""
    if m.u_random is not None:
        return chi2
    rss = chi2 * float(np.mean(problem.covariance.variance))
    return m.size * math.log(max(rss / m.size, floor(problem)))


def aicc(m: Measurements, problem: Problem, found: Minimum) -> float:
    """Akaike's criterion with Hurvich and Tsai's (1989) term for few points."""
    k = found.x.size + (m.u_random is None)  # the noise is a parameter too where it is estimated
    spare = m.size - k - 1
    penalty = 2 * k * m.size / spare if spare > 0 else math.inf
    return _deviance(m, problem, found.chi2) + penalty


def floor(problem: Problem) -> float:
    """The least variance of a point, in 1/sr squared, that a fit may find."""
    return max((LEAST_NOISE * float(np.mean(np.abs(problem.brdf)))) ** 2, 1e-300)


def noise_variance(m: Measurements, problem: Problem, solution: Minimum) -> float:
    """Variance of the whitened residuals: 1 where u is stated, else estimated from them.

    A robust fit's is larger by what counting large residuals less costs.
    """
    spare = m.size - solution.x.size
    if problem.huber is not None and spare > 0:
        r = problem.residual(solution.x)
        return _robust_variance(r, problem.huber, None if m.u_random is not None else spare)
    if m.u_random is not None:
        return 1.0
    return max(solution.chi2 / spare, floor(problem))


def _robust_variance(r: FloatArray, limit: float, spare: int | None) -> float:
    """Mean of psi^2 over the squared mean of its slope (Huber 1981, section 7.6).

    From the residuals, for the `spare` degrees of freedom; with None from the normal distribution,
    for the u is stated, and from the share of the residuals that are none of it.
    """
    if spare is not None:
        psi2 = float(np.sum(np.square(r * weights(r, limit)))) / spare
        return psi2 / max(float(np.mean(np.abs(r) <= limit)), 0.5) ** 2
    wild = float(np.mean(np.abs(r) > NOT_NORMAL))
    inside = math.erf(limit / math.sqrt(2))
    density = math.exp(-(limit**2) / 2) / math.sqrt(2 * math.pi)
    psi2 = inside - 2 * limit * density + limit**2 * (1 - inside)
    return ((1 - wild) * psi2 + wild * limit**2) / max((1 - wild) * inside, 0.5) ** 2
