"""Criteria of a fit: BIC, AICc, and the probability of chi2."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal, norm

from analysis.choice.choice import choose
from analysis.data.covariance import Covariance
from analysis.data.measurements import Measurements
from analysis.fit.criteria import LEAST_NOISE, bic, probability
from analysis.fit.fit import fit
from analysis.models import MODELS
from tests.support.analysis.seeded_scan import scan


def test_bic_with_stated_u_is_the_likelihood_plus_penalty() -> None:
    """-2 ln(likelihood) of a normal distribution, less that of no residual and no shared error."""
    m = scan("lambert", 1, albedo=0.8)
    assert m.u_random is not None
    for c in choose(m, models=["lambert", "oren_nayar"]).candidates:
        C = np.diag(c.problem.covariance.variance)
        C += c.problem.covariance.common @ c.problem.covariance.common.T
        found = multivariate_normal.logpdf(m.brdf, c.predicted, C)
        best = np.sum(norm.logpdf(0.0, scale=m.u_random))
        penalty = len(c.values) * math.log(m.size)
        assert c.bic == pytest.approx(-2 * (found - best) + penalty, abs=1e-6)


def test_a_covariance_that_is_too_large_costs_more_than_it_saves() -> None:
    """Ten times the stated u explains any residuals, and is less likely."""
    m = scan("lambert", 1, albedo=0.8, u_tile=0.0, u_deg=0.0)
    stated = fit(MODELS["lambert"], m)
    wide = replace(
        stated.problem,
        covariance=Covariance(100 * stated.problem.covariance.variance, np.zeros((m.size, 0))),
    )
    assert wide.chi2(stated.x) < 0.011 * (stated.chi2 or 0)
    assert bic(m, wide, wide.solve(stated.x)) > stated.bic + 100


def test_without_stated_u_the_criteria_use_the_residual_sum_of_squares() -> None:
    m = scan("lambert", 1, albedo=0.8)
    bare = Measurements.bare(m.theta_i_deg, m.theta_r_deg, m.dphi_deg, m.brdf)
    found = fit(MODELS["oren_nayar_qualitative"], bare)
    n, rss = bare.size, float(((found.predicted - bare.brdf) ** 2).sum())
    deviance = n * math.log(rss / n)
    assert found.bic == pytest.approx(deviance + 2 * math.log(n))
    # Hurvich and Tsai 1989; the noise is the third parameter.
    assert found.aicc == pytest.approx(deviance + 2 * 3 * n / (n - 3 - 1))


def test_the_probability_of_chi2_is_the_upper_tail() -> None:
    for dof in (1, 2, 3, 7, 8, 93, 94, 20_001):
        for value in (0.0, 0.1, 0.5 * dof, dof, 1.2 * dof, 2.0 * dof, math.inf):
            expected = float(chi2.sf(value, dof))
            assert probability(value, dof) == pytest.approx(expected, rel=1e-9, abs=1e-300)
    assert probability(12.0, 0) == 1.0  # nothing left to test


@pytest.mark.parametrize("robust", [False, True])
def test_values_without_any_noise_have_the_u_of_the_least_noise(robust: bool) -> None:
    m = Measurements.bare(30.0, np.arange(-60.0, 61.0, 10.0), 0.0, 0.2)
    found = fit(MODELS["lambert"], m, robust=robust)
    expected = LEAST_NOISE * found.values["albedo"] / math.sqrt(m.size)
    assert found.u["albedo"] == pytest.approx(expected, rel=0.1)
