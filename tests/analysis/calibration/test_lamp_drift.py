"""Drift of a lamp: known curves are recovered within their u, and noise is no drift."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.calibration.lamp_drift import DriftFit, fit_drift
from instrument.geometry import FloatArray

LEVEL, WITHIN_S, LIMIT = 1800.0, 600.0, 0.002


def curve(age_s: FloatArray, drift: float, warm_up: float, tau_s: float) -> FloatArray:
    return LEVEL * (1 + drift * age_s - warm_up * np.exp(-age_s / tau_s))


def noisy(rng: np.random.Generator, signal: FloatArray, u: float) -> FloatArray:
    return np.asarray(signal + u * LEVEL * rng.standard_normal(signal.size))


def fitted(age_s: FloatArray, signal: FloatArray, u: float) -> DriftFit:
    return fit_drift(age_s, signal, np.full(age_s.size, u * LEVEL))


def test_random_warm_up_curves_are_recovered_within_their_u() -> None:
    """Span, number of readings, noise, size and sign of the warm-up, its time and the drift vary.

    The time to be steady is a part of it, where the limit lies well within what was seen.
    """
    rng, pulls = np.random.default_rng(18), []
    for _ in range(120):
        age_s = np.linspace(0, rng.uniform(300, 1800), int(rng.integers(20, 100)))
        span_s, u = float(age_s[-1]), float(10 ** rng.uniform(-4.5, -3))
        tau_s = span_s * float(np.exp(rng.uniform(np.log(0.06), np.log(0.45))))
        warm_up = float(rng.choice([-1, 1]) * u * rng.uniform(30, 200))
        drift = float(rng.normal()) * 0.02 / 3600
        fit = fitted(age_s, noisy(rng, curve(age_s, drift, warm_up, tau_s), u), u)
        assert fit.tau_s is not None
        true_change = curve(np.array([span_s, span_s + WITHIN_S]), drift, warm_up, tau_s)
        change = fit.change(span_s, WITHIN_S)
        found = [*(fit.estimate(k) for k in range(3)), change]
        truth = [drift, warm_up, tau_s, float(np.diff(true_change)[0]) / LEVEL]
        pulls.append([(f.value - t) / f.u for f, t in zip(found, truth, strict=True)])
    assert np.abs(np.mean(pulls, axis=0)) == pytest.approx(0, abs=0.35)
    assert np.std(pulls, axis=0) == pytest.approx(1, abs=0.25)
    assert np.abs(pulls).max() < 4.5


def test_noise_alone_is_no_drift() -> None:
    rng, pulls = np.random.default_rng(19), []
    for _ in range(150):
        age_s = np.linspace(0, 400, int(rng.integers(8, 60)))
        fit = fitted(age_s, noisy(rng, np.full(age_s.size, LEVEL), 1e-3), 1e-3)
        assert fit.tau_s is None
        assert fit.warm_up == 0
        pulls.append(fit.drift_per_s / fit.estimate(0).u)
    assert np.std(pulls) == pytest.approx(1, abs=0.2)
    assert np.abs(pulls).max() < 4


def test_a_lamp_without_drift_is_steady_from_the_start() -> None:
    age_s = np.linspace(0, 300, 31)
    fit = fitted(age_s, np.full(31, LEVEL), 1e-4)
    assert fit.change(300, WITHIN_S).value == pytest.approx(0, abs=1e-12)
    assert fit.steady(LIMIT, WITHIN_S) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("drift", "warm_up"),
    [(0.0, 0.05), (2e-6, 0.05), (-2e-6, 0.05), (2e-6, -0.03), (-2e-6, -0.03), (0.0, 1e-3)],
)
def test_steady_is_the_time_after_which_no_change_exceeds_the_limit(
    drift: float, warm_up: float
) -> None:
    age_s = np.linspace(0, 2400, 400)
    fit = fitted(age_s, curve(age_s, drift, warm_up, 240.0), 1e-6)
    steady = fit.steady(LIMIT, WITHIN_S)
    assert steady is not None
    changes = np.array([fit.change(t, WITHIN_S).value for t in age_s])
    beyond = age_s[np.abs(changes) > LIMIT]
    assert steady.value == pytest.approx(beyond.max(initial=0.0), abs=6.1)
    # A change of the limit by its u moves the time by its own u.
    if steady.value > 0:
        u_change = fit.change(steady.value, WITHIN_S).u
        later = fit.steady(LIMIT - u_change, WITHIN_S)
        assert later is not None
        assert later.value - steady.value == pytest.approx(steady.u, rel=0.05)


def test_a_steady_drift_beyond_the_limit_is_never_steady() -> None:
    age_s = np.linspace(0, 600, 60)
    fit = fitted(age_s, curve(age_s, 1.1 * LIMIT / WITHIN_S, 0.05, 60.0), 1e-5)
    assert fit.steady(LIMIT, WITHIN_S) is None


def test_a_lamp_that_wanders_has_a_larger_u() -> None:
    rng, age_s = np.random.default_rng(20), np.linspace(0, 600, 60)
    signal = noisy(rng, np.full(60, LEVEL), 1e-3)
    right, small = (fitted(age_s, signal, u) for u in (1e-3, 2e-4))
    assert small.chi2 == pytest.approx(25 * right.chi2, rel=0.1)
    assert small.estimate(0).u == pytest.approx(right.estimate(0).u, rel=0.15)


def test_a_black_level_that_may_have_changed_counts_as_drift() -> None:
    age_s = np.linspace(0, 600, 60)
    fit = fit_drift(age_s, np.full(60, LEVEL), np.full(60, 1e-3), u_black_dn=1.8)
    assert fit.estimate(0).u * 600 == pytest.approx(1e-3, rel=0.01)


def test_a_warm_up_much_slower_than_the_watch_is_not_foretold() -> None:
    """Its end cannot be seen: the change to come is as uncertain as it is large."""
    rng, age_s = np.random.default_rng(21), np.linspace(0, 120, 13)
    fit = fitted(age_s, noisy(rng, curve(age_s, 0.0, 0.2, 900.0), 5e-4), 5e-4)
    change = fit.change(120, WITHIN_S)
    assert abs(change.value) + 3 * change.u > 0.05
