"""Drift of a lamp over time: a steady change, and an exponential warm-up where the data show one.

light(t) = level * (1 + drift_per_s * t - warm_up * exp(-t / tau_s)), t from the first reading. From
the fit follows the change within any time to come, and the time from which it is small.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from analysis.calibration.level_series import Estimate
from instrument.geometry import FloatArray

LEAST_READINGS = 8  # four parameters, and as many again to judge them
_SHOWN = 20.0  # fall of chi² that shows a warm-up: noise reaches it in 1 of 2000 series
_FASTEST, _SLOWEST = 0.5, 3.0  # times the reading interval, and times the time watched: tau_s
_STEPS = 24  # of tau_s, before the best one is refined


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftFit:
    """Drift of a lamp, relative to its level without warm-up at the first reading.

    warm_up: share of the light that is missing then; negative for a lamp that grows darker. tau_s:
    its time constant, None where no warm-up shows. covariance: (3, 3), of drift_per_s, warm_up and
    the logarithm of tau_s. chi2: for each degree of freedom; it enlarges the covariance above 1.
    """

    level_dn: float
    drift_per_s: float
    warm_up: float
    tau_s: float | None
    covariance: FloatArray
    chi2: float

    def estimate(self, index: int) -> Estimate:
        """Return a parameter with its u: 0 drift_per_s, 1 warm_up, 2 tau_s."""
        value = (self.drift_per_s, self.warm_up, self.tau_s or 0.0)[index]
        u = float(np.sqrt(self.covariance[index, index]))
        return Estimate(value, u * value if index == 2 else u)

    def change(self, at_s: float, within_s: float) -> Estimate:
        """Return the relative change of the light in the `within_s` seconds from `at_s` on."""
        if self.tau_s is None:
            gradient, value = np.array([within_s, 0.0, 0.0]), self.drift_per_s * within_s
        else:
            ages = np.array([at_s, at_s + within_s]) / self.tau_s
            left = np.exp(-ages)
            gone, slower = float(left[0] - left[1]), float(ages @ (left * [1.0, -1.0]))
            value = self.drift_per_s * within_s + self.warm_up * gone
            gradient = np.array([within_s, gone, self.warm_up * slower])
        return Estimate(value, float(np.sqrt(gradient @ self.covariance @ gradient)))

    def steady(self, limit: float, within_s: float) -> Estimate | None:
        """Return the time in s from which no change within `within_s` exceeds a relative limit.

        None if the steady drift alone exceeds it.
        """
        drift = self.drift_per_s * within_s
        if abs(drift) >= limit:
            return None
        if self.tau_s is None:
            return Estimate(0.0, 0.0)
        first = self.warm_up * float(-np.expm1(-within_s / self.tau_s))
        room = limit - drift if first > 0 else limit + drift
        if abs(first) <= room:
            return Estimate(0.0, 0.0)
        at_s = self.tau_s * float(np.log(abs(first) / room))
        return Estimate(at_s, self.change(at_s, within_s).u / (room / self.tau_s))


class _Solved(NamedTuple):
    chi2: float
    values: FloatArray
    columns: FloatArray


def fit_drift(
    age_s: FloatArray, signal_dn: FloatArray, u_dn: FloatArray, u_black_dn: float = 0.0
) -> DriftFit:
    """Return the drift of a lamp from readings (n,): times in s, signal and its u in DN.

    u_black_dn: of the change of the black level from the first to the last reading. Fewer than
    `LEAST_READINGS` show no warm-up, fewer than 3 determine nothing.
    """
    straight = _solve(age_s, signal_dn, u_dn, None)
    if age_s.size < LEAST_READINGS:
        return _result(age_s, u_dn, straight, None, u_black_dn)
    tau_s = _best_tau_s(age_s, signal_dn, u_dn)
    curved = _solve(age_s, signal_dn, u_dn, tau_s)
    scale = max(curved.chi2 / (age_s.size - 4), 1.0)
    if straight.chi2 - curved.chi2 < _SHOWN * scale:
        return _result(age_s, u_dn, straight, None, u_black_dn)
    return _result(age_s, u_dn, curved, tau_s, u_black_dn)


def _best_tau_s(age_s: FloatArray, signal_dn: FloatArray, u_dn: FloatArray) -> float:
    """Return the time constant in s of the least chi²; all else is linear and solved for."""
    from scipy.optimize import minimize_scalar

    span_s = float(np.ptp(age_s))
    ends = np.log([_FASTEST * span_s / (age_s.size - 1), _SLOWEST * span_s])
    grid = np.linspace(ends[0], ends[1], _STEPS)

    def chi2(log_tau: float) -> float:
        return _solve(age_s, signal_dn, u_dn, float(np.exp(log_tau))).chi2

    best = int(np.argmin([chi2(float(log_tau)) for log_tau in grid]))
    around = (float(grid[max(best - 1, 0)]), float(grid[min(best + 1, _STEPS - 1)]))
    found = minimize_scalar(chi2, bounds=around, method="bounded", options={"xatol": 1e-4})
    return float(np.exp(found.x))


def _solve(
    age_s: FloatArray, signal_dn: FloatArray, u_dn: FloatArray, tau_s: float | None
) -> _Solved:
    """Return the least squares solution: level, change per s, and light missing at first, in DN."""
    columns = [np.ones(age_s.size), age_s]
    if tau_s is not None:
        columns.append(-np.exp(-age_s / tau_s))
    matrix = np.stack(columns, axis=1) / u_dn[:, None]
    values: FloatArray = np.asarray(np.linalg.lstsq(matrix, signal_dn / u_dn, rcond=None)[0])
    rest = signal_dn / u_dn - matrix @ values
    return _Solved(float(rest @ rest), values, matrix)


def _result(
    age_s: FloatArray, u_dn: FloatArray, solved: _Solved, tau_s: float | None, u_black_dn: float
) -> DriftFit:
    level, per_s, missing = (*solved.values.tolist(), 0.0)[:3]
    columns = solved.columns
    if tau_s is not None:
        slower = -missing * (age_s / tau_s) * np.exp(-age_s / tau_s) / u_dn
        columns = np.column_stack([columns, slower])
    chi2 = solved.chi2 / max(age_s.size - columns.shape[1], 1)
    own = np.linalg.pinv(columns.T @ columns) * max(chi2, 1.0)
    # Relative values: all but the logarithm of tau_s are divided by the level.
    to_relative = np.zeros((3, 4))
    to_relative[0, :2] = -per_s / level**2, 1 / level
    to_relative[1, [0, 2]] = -missing / level**2, 1 / level
    to_relative[2, 3] = 1.0
    used = to_relative[:, : columns.shape[1]]
    covariance = used @ own @ used.T
    covariance[0, 0] += (u_black_dn / level / max(float(np.ptp(age_s)), 1e-9)) ** 2
    return DriftFit(
        level_dn=level,
        drift_per_s=per_s / level,
        warm_up=missing / level,
        tau_s=tau_s,
        covariance=covariance,
        chi2=chi2,
    )
