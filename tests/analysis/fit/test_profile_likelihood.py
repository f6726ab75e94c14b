"""Profile-likelihood intervals of parameters."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.data.covariance import Covariance
from analysis.fit.profile_likelihood import interval
from analysis.fit.search.problem import Problem
from analysis.models import MODELS
from instrument.geometry import Geometry


def test_the_interval_of_a_straight_line_is_1_96_u() -> None:
    geometry = Geometry.from_degrees(theta_i=30, theta_r=[0.0, 20.0, 40.0])
    C = Covariance(np.full(3, 1e-6), np.zeros((3, 0)))
    problem = Problem(MODELS["lambert"], geometry, np.array([0.159, 0.160, 0.161]), C)
    best = problem.solve(np.array([0.4]))
    u = np.pi * 1e-3 / np.sqrt(3)
    low, high = interval(problem, best, 0)
    assert low == pytest.approx(0.16 * np.pi - 1.96 * u, abs=0.03 * u)
    assert high == pytest.approx(0.16 * np.pi + 1.96 * u, abs=0.03 * u)
