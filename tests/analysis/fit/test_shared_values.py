"""Most likely values of shared errors: those of a fit that has them as parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.data.measurements import Measurements, SharedError
from analysis.fit.fit import FitResult, fit
from analysis.fit.shared_values import SharedValue, shared_values
from analysis.models import MODELS
from instrument.geometry import Geometry

U_TILT_DEG, U_NOISE = 0.1, 2e-4
VALUES = {"albedo": 0.6, "sigma_deg": 25.0}


def tilted(tilt_deg: float, u_deg: float) -> Measurements:
    """A matt surface that leans by an angle, with the error that such a tilt is stated to be."""
    theta_i, theta_r = (a.ravel() for a in np.meshgrid([20.0, 60.0], np.linspace(-75, 75, 16)))
    seen = Geometry.from_degrees(theta_i=theta_i - tilt_deg, theta_r=theta_r - tilt_deg)
    light = np.cos(np.radians(theta_i - tilt_deg)) / np.cos(np.radians(theta_i))
    value = light * MODELS["oren_nayar"].brdf(seen, **VALUES)
    value = value * (1 + U_NOISE * np.random.default_rng(1).standard_normal(value.size))
    m = Measurements.bare(theta_i, theta_r, 0.0, value, U_NOISE * value)
    if not u_deg:
        return m
    one = np.full(value.size, u_deg)
    brighter = np.tan(np.radians(theta_i)) * np.radians(one)
    zero = np.zeros(value.size, dtype=np.int64)
    return replace(m, shared=(SharedError("sample tilt", brighter, zero, -one, -one),))


def value_of(result: FitResult) -> SharedValue:
    (found,) = shared_values(result)
    return found


def test_a_tilt_of_one_u_is_absorbed_and_found() -> None:
    result, blind = (fit(MODELS["oren_nayar"], tilted(U_TILT_DEG, u)) for u in (U_TILT_DEG, 0.0))
    assert result.chi2 is not None
    assert blind.chi2 is not None
    assert result.chi2 < 60
    assert blind.chi2 > 600
    found = value_of(result)
    assert found.name == "sample tilt"
    assert found.value == pytest.approx(1.0, abs=3 * found.u)
    assert found.u < 0.1
    for name, true in VALUES.items():
        u = result.u[name]
        assert u is not None
        assert abs(result.values[name] - true) < 3 * u


def test_the_u_of_the_parameters_holds_that_of_the_tilt() -> None:
    level = tilted(0.0, 0.0)
    known, open_ = (fit(MODELS["oren_nayar"], m) for m in (level, tilted(0.0, U_TILT_DEG)))
    for name in VALUES:
        less, more = known.u[name], open_.u[name]
        assert less is not None
        assert more is not None
        assert more > less
    assert value_of(open_).value == pytest.approx(0.0, abs=3 * value_of(open_).u)


def test_values_and_u_are_those_of_the_joint_normal_equations() -> None:
    """Parameters and errors side by side, each error with a prior of u 1."""
    result = fit(MODELS["oren_nayar"], tilted(U_TILT_DEG, U_TILT_DEG))
    problem, m = result.problem, tilted(U_TILT_DEG, 0.0)
    gradients = MODELS["oren_nayar"].gradient(m.geometry, **result.values)
    columns = [*(gradients[name] for name in VALUES), np.asarray(problem.covariance.common)[:, 0]]
    A = np.stack(columns, axis=1) / np.sqrt(problem.covariance.variance)[:, np.newaxis]
    normal = A.T @ A + np.diag([0.0, 0.0, 1.0])
    found = value_of(result)
    assert found.u == pytest.approx(np.sqrt(np.linalg.inv(normal)[2, 2]), rel=1e-6)
    assert found.value == pytest.approx(result.pulls["sample tilt"])
