"""Rounding to whole counts: its error in a mean, and a dark corrected for it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtr

from acquisition.measure.rounding import dark_rounding_dn, rounded_normal, rounding_u_dn
from instrument.geometry import FloatArray

SIZE, FRAMES = 100, 8
Pattern = Callable[[np.random.Generator], FloatArray]


def _mean_and_variance(level: float, sd: float) -> tuple[float, float]:
    """Mean and variance of rounded normal counts, from their distribution."""
    counts = np.arange(-9, 11)
    edges = (np.append(counts - 0.5, counts[-1] + 0.5) - level) / max(sd, 1e-9)
    part = np.diff(ndtr(edges))
    mean = float(part @ counts)
    return mean, float(part @ np.square(counts - mean))


@pytest.mark.parametrize("sd", [0.0, 0.1, 0.2, 0.3, 0.5])
def test_the_rounding_error_is_that_of_the_fourier_series(sd: float) -> None:
    levels = np.arange(0.0005, 1, 0.001)
    error = np.array([_mean_and_variance(level, sd)[0] for level in levels]) - levels
    assert rounding_u_dn(sd**2) == pytest.approx(np.sqrt(np.mean(error**2)), abs=2e-4)


def test_without_noise_rounding_is_a_uniform_error() -> None:
    assert rounding_u_dn(0.0) == pytest.approx(1 / np.sqrt(12), rel=2e-3)


@given(st.floats(0, 1), st.floats(0, 1))
def test_more_noise_means_less_rounding_error(a: float, b: float) -> None:
    low, high = sorted((a, b))
    assert rounding_u_dn(high) <= rounding_u_dn(low)


@given(st.floats(-1, 1), st.floats(0.06, 1))
def test_mean_and_variance_of_rounded_counts_are_those_of_their_distribution(
    level: float, sd: float
) -> None:
    mean, variance = _mean_and_variance(level, sd)
    error, rounded = rounded_normal(np.array(level), np.array(sd**2))
    assert (float(error), float(rounded)) == pytest.approx((mean - level, variance), abs=1e-5)


def _errors(sd: float, pattern: Pattern, seeds: range) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Errors of darks at random levels, as they are and corrected, and the corrected one's u."""
    found = []
    for seed in seeds:
        random = np.random.default_rng([seed, 3])
        true = random.uniform(7.5, 8.5) + pattern(random)
        counts = np.rint(true + sd * random.standard_normal((FRAMES, SIZE, SIZE)))
        mean, variance = counts.mean(axis=0), counts.var(axis=0, ddof=1)
        weights = np.full_like(mean, 1 / mean.size)
        rounding, u = dark_rounding_dn(mean, variance, weights, FRAMES)
        off = float(np.mean(mean - true))
        u_noise = np.sqrt(np.mean(variance) / FRAMES) / SIZE
        found.append((off, off - rounding, np.hypot(u, u_noise)))
    plain, corrected, stated = np.array(found).T
    return plain, corrected, stated


def _rms(x: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def _equal(random: np.random.Generator) -> FloatArray:
    return np.zeros((SIZE, SIZE))


def _hot(random: np.random.Generator) -> FloatArray:
    return np.where(random.random((SIZE, SIZE)) < 0.002, 50.0, 0.0)


@pytest.mark.parametrize("pattern", [_equal, _hot])
@pytest.mark.parametrize("sd", [0.25, 0.3, 0.4])
def test_the_rounding_error_of_a_dark_is_found_from_its_counts(sd: float, pattern: Pattern) -> None:
    """Without the correction all frames and pixels together are off by up to 0.09 counts."""
    plain, corrected, _ = _errors(sd, pattern, range(30))
    assert _rms(plain) == pytest.approx(rounding_u_dn(sd**2), rel=0.4)
    noise = np.hypot(sd, 0.3) / np.sqrt(FRAMES) / SIZE
    assert _rms(corrected) < 3 * noise < _rms(plain)


@pytest.mark.parametrize("sd", [0.02, 0.1, 0.15, 0.2, 0.25, 0.3, 0.5, 0.8])
def test_the_stated_uncertainty_is_the_size_of_what_remains(sd: float) -> None:
    """Also where hardly any noise dithers the counts, so that the level is not determined."""
    _, corrected, u = _errors(sd, _equal, range(60))
    assert 0.2 < _rms(corrected / u) < 1.4
    assert np.mean(np.abs(corrected) < 1.96 * u) > 0.9
    assert np.all(u < 1 / np.sqrt(12) + 0.03)  # half of the counts that are possible: 0.3


@pytest.mark.parametrize("width", [0.1, 0.3])
def test_pixels_of_skewed_offsets_leave_more_uncertainty(width: float) -> None:
    """Their distribution is not the normal one that the correction assumes."""

    def skewed(random: np.random.Generator) -> FloatArray:
        return random.exponential(width, (SIZE, SIZE))

    _, corrected, u = _errors(0.2, skewed, range(60))
    assert _rms(corrected / u) < 1.4
    assert np.median(u) > 2 * np.median(_errors(0.2, _equal, range(60))[2])
