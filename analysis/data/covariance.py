"""Covariance of the measured points: independent errors and those that points share.

C = diag(variance) + common common^T, each column of `common` being one error that several points
share: how far one standard deviation of it shifts each of them (GUM, and Cox and Harris,
generalised least squares).
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array, hstack

from analysis.data.measurements import Measurements
from instrument.geometry import BoolArray, Brdf, FloatArray, Geometry, IntArray

LAMP_LEVEL = "lamp level"
Columns = FloatArray | csr_array

_MOST_FULL = 100_000  # entries of a full array; of more, few are not 0
_ANY_LEVEL = 1.0  # relative u of a level that is not known at all


@dataclass(frozen=True, slots=True)
class Covariance:
    """C = diag(variance) + common common^T of N points with K shared errors.

    variance: (N,), independent variances, positive, in the square of the data's unit.
    common: (N, K), standard shifts by each shared error, in the data's unit; sparse for a long
        scan, of which a full array would fill the memory.
    names: what each shared error is, in words; empty where nobody has named them.
    """

    variance: FloatArray
    common: Columns
    names: tuple[str, ...] = ()
    _own: Columns = field(init=False, repr=False)
    _vectors: FloatArray = field(init=False, repr=False)
    _shrink: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if np.any(self.variance <= 0) or not np.all(np.isfinite(self.variance)):
            raise ValueError(
                f"variance = {self.variance.min():g}; allowed: finite, more than 0 for every point"
            )
        # In units of the independent errors C is 1 + V V^T, and with V^T V = W diag(s) W^T its
        # inverse root is 1 - V W diag((1 - 1 / sqrt(1 + s)) / s) W^T V^T. The same chi2 as from
        # a Cholesky factor of C, at the cost of K^3 and without a matrix of N x N.
        V = _scaled(self.common, 1 / np.sqrt(self.variance))
        s, W = np.linalg.eigh(_product(V.T, V))
        root = np.sqrt(1 + np.maximum(s, 0.0))
        object.__setattr__(self, "_own", V)
        object.__setattr__(self, "_vectors", W)
        object.__setattr__(self, "_shrink", 1 / (root * (1 + root)))

    def whiten(self, x: FloatArray) -> FloatArray:
        """C^(-1/2) x for x of shape (N,) or (N, M): residuals become independent with u = 1."""
        scale = np.sqrt(self.variance)
        return self._unshared(x / (scale if x.ndim == 1 else scale[:, np.newaxis]))

    def _unshared(self, y: FloatArray) -> FloatArray:
        """(1 + V V^T)^(-1/2) y, of y in units of the independent errors."""
        if self.common.shape[1] == 0:
            return np.asarray(y)
        inner = self._vectors.T @ (self._own.T @ y)
        shrink = self._shrink if y.ndim == 1 else self._shrink[:, np.newaxis]
        return np.asarray(y - self._own @ (self._vectors @ (shrink * inner)))

    def pulls(self, residual: FloatArray) -> FloatArray:
        """The likeliest value of each shared error behind a residual (N,), in units of its u, (K,).

        The mean of the errors' normal distribution given the residual: common^T C^-1 residual.
        """
        return np.asarray(self._own.T @ self._unshared(self.whiten(residual)))

    def of(self, points: BoolArray) -> Covariance:
        """Covariance of some of the points (N,)."""
        return Covariance(self.variance[points], self.common[points], self.names)

    @property
    def u_total(self) -> FloatArray:
        """Standard uncertainty of each point, (N,): the root of C's diagonal."""
        return np.asarray(np.sqrt(self.variance + (self.common * self.common).sum(axis=1)))

    @property
    def u_independent(self) -> FloatArray:
        """The part of it that no other point shares, (N,)."""
        return np.sqrt(self.variance)

    def matrix(self) -> FloatArray:
        """C in full, (N, N)."""
        return np.asarray(np.diag(self.variance) + _product(self.common, self.common.T))


def _scaled(columns: Columns, by: FloatArray) -> Columns:
    """Each row (N, K) times its own factor (N,)."""
    if isinstance(columns, np.ndarray):
        return np.asarray(columns * by[:, np.newaxis])
    return columns.multiply(by[:, np.newaxis]).tocsr()


def with_column(columns: Columns, column: FloatArray) -> Columns:
    """One shared error (N,) more."""
    if isinstance(columns, np.ndarray):
        return np.column_stack([columns, column])
    return csr_array(hstack([columns, csr_array(column[:, np.newaxis])]))


def _product(left: Any, right: Any) -> FloatArray:
    """The matrix product in full, of full or sparse arrays (scipy's types do not mix them)."""
    product = left @ right
    return np.asarray(product if isinstance(product, np.ndarray) else product.toarray(), np.float64)


def independent(measurements: Measurements) -> Covariance:
    """Covariance of `u_random` alone; where that is not stated, of 1 for every point."""
    u = measurements.u_random
    variance = np.ones(measurements.size) if u is None else np.square(u)
    return Covariance(variance, np.zeros((measurements.size, 0)))


def shared(
    measurements: Measurements,
    smooth: Brdf,
    own: Brdf | None = None,
) -> Covariance:
    """Covariance of all stated uncertainties, around models near the data (BRDF in 1/sr).

    `smooth`, the best model so far, turns the error of theta_r, which a stage repeats at every
    return to an angle, into one of the BRDF: the same for every model that is fitted. `own`
    (default `smooth`) is the model that is being fitted: it turns the other shared errors into
    shifts. With another model's shifts, a large enough error of the tile would pass for the
    structure in which the two models differ.

    Relative errors are multiplied with a model and not with the data: scaled by noisy data, a
    common relative error pulls the fit towards the low points (Peelle's pertinent puzzle).
    Raises `ValueError` where `u_random` is not stated.
    """
    m, own = measurements, own or smooth
    if m.u_random is None:
        raise ValueError("u_random is not stated; allowed: a u_random in 1/sr for every point")
    f = own(m.geometry)
    view, incidence, azimuth = (
        {"theta_r": m.u_theta_r_deg},
        {"theta_i": m.u_theta_i_deg},
        {"dphi": m.u_dphi_deg},
    )
    groups: list[tuple[str, FloatArray, IntArray | FloatArray]] = [
        ("theta_r", change(m, smooth, **view), m.theta_r_deg),
        ("theta_i, lamp setting", change(m, own, **incidence), m.lamp_setting),
        ("dphi, lamp setting", change(m, own, **azimuth), m.lamp_setting),
        *((error.name, f * error.u_relative, error.group) for error in m.shared),
    ]
    if m.free_levels:
        groups.append((LAMP_LEVEL, _ANY_LEVEL * f, m.lamp_setting))
    bends = [_second_order_u(m, smooth, **angle) for angle in (view, incidence, azimuth)]
    variance = np.square(m.u_random) + np.sum(np.square(bends), axis=0)
    columns, names = [], []
    for name, shift, group in groups:
        alone, several, labels = _columns(shift, group)
        variance = variance + np.square(alone)
        columns.append(several)
        names += [f"{name}{label}" for label in labels]
    common = csr_array(hstack(columns))
    few = common.shape[0] * common.shape[1] <= _MOST_FULL
    return Covariance(variance, common.toarray() if few else common, _numbered(names))


def _columns(
    shift: FloatArray, group: IntArray | FloatArray
) -> tuple[FloatArray, csc_array, list[str]]:
    """Shifts (N,) of points that share theirs with none; a column and a label a larger group.

    The points of a group have the same number in `group`, or the same angle in degrees.
    """
    values, member, count = np.unique(group, return_inverse=True, return_counts=True)
    alone = count[member] == 1
    several = np.flatnonzero((count > 1) & (np.bincount(member, np.abs(shift)) > 0))
    column = np.full(values.size, -1)
    column[several] = np.arange(several.size)
    rows = np.flatnonzero(column[member] >= 0)
    places = (rows, column[member[rows]])
    columns = csc_array((shift[rows], places), shape=(shift.size, several.size))
    if np.issubdtype(group.dtype, np.floating):
        labels = [f" at {value:g} degrees" for value in values[several]]
    else:
        labels = [f" {value + 1}" if values.size > 1 else "" for value in values[several]]
    return np.where(alone, shift, 0.0), columns, labels


def _numbered(names: list[str]) -> tuple[str, ...]:
    """Names that stand several times get a number each."""
    seen: dict[str, int] = {}
    apart, often = [], Counter(names)
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        apart.append(name if often[name] == 1 else f"{name} {seen[name]}")
    return tuple(apart)


def change(m: Measurements, smooth: Brdf, **angle: float) -> FloatArray:
    """Half the change of the model from -u to +u of an angle (degrees), (N,): (df/dx) u.

    Steps of u itself, so that a kink counts as far as u reaches over it. Beyond 90 degrees there
    is no geometry: there the change on the other side counts alone.
    """
    if not any(angle.values()):
        return np.zeros(m.size)
    up, up_step = _moved(m, 1, **angle)
    down, down_step = _moved(m, -1, **angle)
    return np.asarray((smooth(up) - smooth(down)) / (up_step + down_step))


def _second_order_u(m: Measurements, smooth: Brdf, **angle: float) -> FloatArray:
    """What a straight line leaves of an angle's error, (N,): its u by the next term of the series.

    A normal error of u adds (d2f/dx2) u^2 / 2 times a square of mean square 3 (GUM, 5.1.2, note).
    """
    if not any(angle.values()):
        return np.zeros(m.size)
    (up, up_step), (down, down_step) = _moved(m, 1, **angle), _moved(m, -1, **angle)
    both = up_step * down_step  # beyond 90 degrees there is no second side to compare with
    return np.asarray(both * np.sqrt(3) * (smooth(up) + smooth(down) - 2 * smooth(m.geometry)) / 2)


def _moved(
    m: Measurements, sign: int, *, theta_i: float = 0.0, theta_r: float = 0.0, dphi: float = 0.0
) -> tuple[Geometry, FloatArray]:
    """Geometry with the angles moved, and 1 where that could be done, 0 where not."""
    new_i, new_r = m.theta_i_deg + sign * theta_i, m.theta_r_deg + sign * theta_r
    inside = (np.abs(new_i) <= 90) & (np.abs(new_r) <= 90)
    new_i, new_r = np.where(inside, new_i, m.theta_i_deg), np.where(inside, new_r, m.theta_r_deg)
    # A lamp that passes the normal stands on the other side: dphi turns by 180.
    new_dphi = m.dphi_deg + sign * dphi + np.where(new_i < 0, 180.0, 0.0)
    moved = Geometry.from_degrees(theta_i=np.abs(new_i), theta_r=new_r, dphi=new_dphi)
    return moved, inside.astype(np.float64)
