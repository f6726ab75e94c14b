"""Fit of the response curve: counts of a constant light against the exposure.

Candidates are polynomials of rising order, a gamma, and the curves of sRGB and ITU-R BT.709; the
simplest that the data support is chosen. Black level, light and a drift of the lamp are fitted too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from analysis.calibration.level_series import LevelSeries
from instrument.calibration.response_curve import BT709, GAMMA, POLYNOMIAL, SRGB, ResponseCurve
from instrument.geometry import FloatArray

MOST_ORDERS = 3  # of the polynomial: a residual non-linearity has one or two bends
_VIDEO = 0.03  # an exponent so far from 1 is no residual non-linearity; cameras state below 1 %
_COMMON = 3  # parameters that each curve has: black level, rate, drift


@dataclass(frozen=True, slots=True, kw_only=True)
class ResponseFit:
    """Chosen curve with what was fitted beside it.

    black_dn: counts without light, extrapolated. rate_per_s: light per second, in shares of full
    scale. drift_per_s: relative change of the light. covariance: of (black_dn, rate_per_s,
    drift_per_s, the curve's parameters). chi2_per_point: of the residuals; u includes an excess.
    residual_relative: largest one above 5 % of full scale. u_light_relative: of light from counts,
    from 10 to 90 % of full scale, beside the scale. low_dn, high_dn: counts between which it holds.
    """

    curve: ResponseCurve
    max_dn: float
    black_dn: float
    rate_per_s: float
    drift_per_s: float
    covariance: FloatArray
    chi2_per_point: float
    residual_relative: float
    u_light_relative: float
    low_dn: float
    high_dn: float

    def share(self, counts_dn: FloatArray) -> FloatArray:
        """Return counts, of any shape in DN, as shares of full scale."""
        return (counts_dn - self.black_dn) / (self.max_dn - self.black_dn)

    def light(self, mean_dn: FloatArray, variance_dn2: FloatArray | float = 0.0) -> FloatArray:
        """Return the mean light (n,), in shares of full scale, of pixels of this mean and variance.

        mean_dn, variance_dn2: (n,) in DN and DN².
        """
        share, span = self.share(mean_dn), self.max_dn - self.black_dn
        bent = self.curve.curvature(share) * variance_dn2 / span**2 / 2
        return np.asarray(self.curve.light(share) + bent, dtype=np.float64)

    @property
    def span_dn(self) -> float:
        """Range of counts above black."""
        return self.max_dn - self.black_dn

    def moved(self, steps: FloatArray) -> ResponseFit:
        """Return the fit with its parameters changed by `steps` (parameters,), in their units."""
        own = tuple(float(v) for v in np.asarray(self.curve.parameters) + steps[_COMMON:])
        return replace(
            self,
            curve=ResponseCurve(self.curve.kind, own),
            black_dn=self.black_dn + float(steps[0]),
            rate_per_s=self.rate_per_s + float(steps[1]),
            drift_per_s=self.drift_per_s + float(steps[2]),
        )

    def nonlinearity(self) -> float:
        """Return by how much counts per light vary from 5 to 95 % of full scale, relative."""
        share = np.linspace(0.05, 0.95, 91)
        ratio = share / self.curve.light(share)
        return float((ratio.max() - ratio.min()) / ratio.mean())

    def shape_u_relative(self) -> float:
        """Return the largest relative u of light from counts, from 10 to 90 % of full scale.

        It is that of this curve's parameters. A factor common to all counts is part of the scale.
        """
        share = np.linspace(0.1, 0.9, 17)
        counts = self.black_dn + share * self.span_dn
        size = np.sqrt(np.diag(self.covariance))
        columns = []
        for i, step in enumerate(size):
            steps = np.zeros(size.size)
            steps[i] = step
            change = np.log(self.moved(steps).light(counts) / self.light(counts))
            columns.append((change - change.mean()) / step if step else np.zeros(share.size))
        matrix = np.stack(columns, axis=1)
        variance = np.einsum("ij,jk,ik->i", matrix, self.covariance, matrix)
        return float(np.sqrt(max(variance.max(), 0.0)))


def fit_response(
    lit: LevelSeries, u_mean_dn: FloatArray, max_dn: float, dark_dn: float
) -> ResponseFit:
    """Return the response that explains the levels of `lit`, none of which may be saturated.

    u_mean_dn: (exposures,) in DN. dark_dn: level without light at a short exposure.
    """
    fits = [_fit(lit, u_mean_dn, max_dn, dark_dn, curve) for curve in _candidates(lit, dark_dn)]
    size = lit.mean_dn.size
    scale = max(1.0, min(chi2 / max(size - k, 1) for _, chi2, k in fits))
    best = min(fits, key=lambda fit: fit[1] / scale + _penalty(fit[2], size))
    # A bend that is too small to be chosen may be there all the same.
    polynomials = [] if best[0].curve.is_video else fits
    bent = [f for f, _, k in polynomials if k == best[2] + 1 and not f.curve.is_video]
    u = max(fit.shape_u_relative() for fit in (best[0], *bent))
    return replace(best[0], u_light_relative=u)


def _penalty(parameters: int, size: int) -> float:
    """Return what parameters must earn in chi²: by BIC, with AIC's correction for few data."""
    free = max(size - parameters - 1, 1)
    return parameters * float(np.log(size)) + 2 * parameters * (parameters + 1) / free


def _candidates(lit: LevelSeries, dark_dn: float) -> Iterator[ResponseCurve]:
    """Yield the curves to try, with starting values."""
    orders = min(MOST_ORDERS, lit.mean_dn.size - _COMMON - 2)
    for order in range(max(orders, 0) + 1):
        yield ResponseCurve(POLYNOMIAL, (0.0,) * order)
    exponent = _exponent(lit, dark_dn)
    if abs(exponent - 1) > _VIDEO:
        yield ResponseCurve(GAMMA, (1 / exponent,))
        yield ResponseCurve(SRGB)
        yield ResponseCurve(BT709)


def _exponent(lit: LevelSeries, dark_dn: float) -> float:
    """Return the slope of log counts by log exposure over the upper half of the counts."""
    signal = lit.mean_dn - dark_dn
    upper = signal > 0.3 * signal.max()
    logs = np.log(lit.exposure_s[upper]), np.log(signal[upper])
    return float(np.polyfit(*logs, 1)[0]) if np.count_nonzero(upper) > 1 else 1.0


def _fit(
    lit: LevelSeries, u_mean_dn: FloatArray, max_dn: float, dark_dn: float, curve: ResponseCurve
) -> tuple[ResponseFit, float, int]:
    """Return the fit of one curve, its chi² and its number of parameters."""
    from scipy.optimize import least_squares

    blank = ResponseFit(
        curve=curve, max_dn=max_dn, black_dn=dark_dn, rate_per_s=1.0, drift_per_s=0.0,
        covariance=np.zeros((0, 0)), chi2_per_point=0.0, residual_relative=0.0,
        u_light_relative=0.0, low_dn=float(lit.mean_dn.min()), high_dn=float(lit.mean_dn.max()),
    )  # fmt: skip
    zero = np.zeros(_COMMON + len(curve.parameters))
    rate = float(np.median(blank.light(lit.mean_dn) / lit.exposure_s))
    start = blank.moved(zero + np.eye(zero.size)[1] * (rate - 1.0))
    unit = np.ones(zero.size)  # natural sizes of the parameters, for the solver's steps
    unit[0], unit[1] = float(u_mean_dn.max()) or 1.0, rate
    unit[2] = 1 / max(float(np.ptp(lit.age_s)), 1e-9)
    first = start.light(lit.mean_dn, lit.variance_dn2)

    def residuals(steps: FloatArray) -> FloatArray:
        return _residuals(start.moved(steps * unit), lit, u_mean_dn)

    found = least_squares(residuals, zero, method="lm" if first.size >= zero.size else "trf")
    chi2 = float(np.sum(found.fun**2))
    free = max(first.size - zero.size, 1)
    jacobian = np.asarray(found.jac, dtype=np.float64) / unit
    inverse = np.linalg.pinv(jacobian)  # of a drift that cannot be told the u is 0, not infinite
    covariance = inverse @ inverse.T * max(1.0, chi2 / free)
    return _finished(start.moved(found.x * unit), lit, covariance, chi2 / free), chi2, zero.size


def _residuals(fit: ResponseFit, lit: LevelSeries, u_mean_dn: FloatArray) -> FloatArray:
    """Return light by the counts minus light by the exposure, in units of u, (exposures,)."""
    u = fit.curve.gradient(fit.share(lit.mean_dn)) * u_mean_dn / fit.span_dn
    expected = fit.rate_per_s * lit.exposure_s * (1 + fit.drift_per_s * _centred(lit.age_s))
    light = fit.light(lit.mean_dn, lit.variance_dn2)
    return np.asarray((light - expected) / np.maximum(np.abs(u), 1e-12), dtype=np.float64)


def _centred(age_s: FloatArray) -> FloatArray:
    return np.asarray(age_s - age_s.mean(), dtype=np.float64)


def _finished(
    fit: ResponseFit, lit: LevelSeries, covariance: FloatArray, chi2_per_point: float
) -> ResponseFit:
    expected = fit.rate_per_s * lit.exposure_s * (1 + fit.drift_per_s * _centred(lit.age_s))
    relative = fit.light(lit.mean_dn, lit.variance_dn2) / expected - 1
    bright = fit.share(lit.mean_dn) > 0.05
    worst = float(np.abs(relative[bright]).max()) if bright.any() else 0.0
    return replace(
        fit, covariance=covariance, chi2_per_point=chi2_per_point, residual_relative=worst
    )
