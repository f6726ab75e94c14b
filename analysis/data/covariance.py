"""Covariance of the measured points: independent errors, and errors that points share.

C = diag(variance) + common common^T. Each column of `common` is one shared error: the shift of
every point by one standard deviation of it (GUM; generalised least squares as in Cox and Harris).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.data.inverse_root import SymmetricRoot, TriangularRoot, inverse_root
from analysis.data.measurements import Measurements
from analysis.data.sweeps import signed_view, sweeps
from instrument.geometry import BoolArray, Brdf, FloatArray, Geometry, IntArray

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    Columns = FloatArray | csr_array

LAMP_LEVEL, ANGLES = "lamp level", "angle setting"
VIEW = "theta_r"
"""Name of the errors of view angles, before the angle of each."""

_MAX_DENSE = 100_000  # entries of a dense array; larger ones are mostly zeros, so sparse
# A model may be steeper than the data between neighbours by this factor: at the flank of a lobe of
# which one point alone is inside. Views closer than the least step count as one view.
_STEEPER, _LEAST_STEP_DEG = 4.0, 0.1
_U_UNKNOWN_LEVEL = 0.3  # relative u of a lamp level, once normalised to a model near the data


@dataclass(frozen=True, slots=True)
class Covariance:
    """C = diag(variance) + common common^T of N points with K shared errors.

    variance: (N,), independent variances, positive, in the square of the data's unit.
    common: (N, K), shifts by one u of each shared error, in the data's unit; sparse for a long
        scan, whose dense array would fill the memory.
    names: name of each shared error, for messages; empty where they have none.
    log_determinant: ln det C, of C in the square of the data's unit.
    """

    variance: FloatArray
    common: Columns
    names: tuple[str, ...] = ()
    _u: FloatArray = field(init=False, repr=False)
    _whitened: Columns = field(init=False, repr=False)
    _root: SymmetricRoot | TriangularRoot = field(init=False, repr=False)
    log_determinant: float = field(init=False)

    def __post_init__(self) -> None:
        if np.any(self.variance <= 0) or not np.all(np.isfinite(self.variance)):
            raise ValueError(
                f"variance = {self.variance.min():g}; allowed: finite, more than 0 for every point"
            )
        # In units of the independent errors C is 1 + V V^T, and its inverse root 1 - V Q V^T: this
        # gives the chi2 of a Cholesky factor of C at a cost of K^3, without an N x N matrix.
        object.__setattr__(self, "_u", np.sqrt(self.variance))
        V = _scaled(self.common, 1 / self._u)
        object.__setattr__(self, "_whitened", V)
        object.__setattr__(self, "_root", inverse_root(_product(V.T, V)))
        log_det = float(np.sum(np.log(self.variance))) + self._root.log_determinant
        object.__setattr__(self, "log_determinant", log_det)

    def whiten(self, x: FloatArray) -> FloatArray:
        """R x for x of shape (N,) or (N, M), in the data's unit, with R^T R = C^-1.

        The result, of the same shape, is in units of u: residuals become independent with u = 1.
        """
        return self._whiten_shared(x / (self._u if x.ndim == 1 else self._u[:, np.newaxis]))

    def _whiten_shared(self, y: FloatArray) -> FloatArray:
        """An inverse root of 1 + V V^T times y, of y in units of the independent errors."""
        if self.common.shape[1] == 0:
            return np.asarray(y)
        return np.asarray(y - self._whitened @ self._root.shrunk(self._whitened.T @ y))

    def pulls(self, residual: FloatArray) -> FloatArray:
        """Most likely value (K,) of each shared error, in units of its u, given a residual (N,).

        The mean of the errors' normal distribution given the residual: common^T C^-1 residual.
        """
        if self.common.shape[1] == 0:
            return np.zeros(0)
        return self._root.solved(self._whitened.T @ (residual / self._u))

    def subset(self, points: BoolArray) -> Covariance:
        """Covariance of the points marked True in `points` (N,)."""
        return Covariance(self.variance[points], self.common[points], self.names)

    @property
    def common_dense(self) -> FloatArray:
        """The shared errors (N, K) without sparsity, in the data's unit by one u."""
        return _dense(self.common)

    @property
    def u_total(self) -> FloatArray:
        """Standard uncertainty (N,) of each point, in the data's unit: root of C's diagonal."""
        return np.asarray(np.sqrt(self.variance + (self.common * self.common).sum(axis=1)))

    @property
    def u_independent(self) -> FloatArray:
        """Independent part (N,) of each point's standard uncertainty, in the data's unit."""
        return self._u


def _scaled(columns: Columns, by: FloatArray) -> Columns:
    """Each row (N, K) times its own factor (N,)."""
    if isinstance(columns, np.ndarray):
        return np.asarray(columns * by[:, np.newaxis])
    return columns.multiply(by[:, np.newaxis]).tocsr()


def append_column(columns: Columns, column: FloatArray) -> Columns:
    """Append a column (N,) to columns (N, K), in the same unit, dense or sparse."""
    if isinstance(columns, np.ndarray):
        return np.column_stack([columns, column])
    from scipy.sparse import csr_array, hstack  # heavy, and for long scans only

    return csr_array(hstack([columns, csr_array(column[:, np.newaxis])]))


def _product(left: Any, right: Any) -> FloatArray:
    """Dense matrix product of dense or sparse arrays (scipy's types do not mix them)."""
    return _dense(left @ right)


def _dense(matrix: Any) -> FloatArray:
    return np.asarray(matrix if isinstance(matrix, np.ndarray) else matrix.toarray(), np.float64)


def independent_covariance(measurements: Measurements) -> Covariance:
    """Covariance of `u_random` alone; where that is not stated, 1 for every point."""
    u = measurements.u_random
    variance = np.ones(measurements.size) if u is None else np.square(u)
    return Covariance(variance, np.zeros((measurements.size, 0)))


def has_shared_errors(m: Measurements) -> bool:
    """True if more than `u_random` is stated: `full_covariance` then differs from that alone."""
    angles = m.u_theta_i_deg, m.u_theta_r_deg, m.u_dphi_deg
    return bool(m.shared) or m.free_levels or any(angles)


def full_covariance(
    measurements: Measurements, brdf: Brdf, *, repeatable: bool = False
) -> Covariance:
    """Covariance of all stated uncertainties, linearised about a model near the data.

    `brdf` returns the model's BRDF in 1/sr, of the geometry's shape. It converts the errors of the
    angles into errors of the BRDF, and the relative ones: multiplied with noisy data instead, a
    common relative error pulls the fit towards the low points (Peelle's pertinent puzzle).

    Each model is given its own curve, so that its fit does not depend on the others. Two guards
    keep a model from hiding a misfit behind the steepness of its own lobe. The error of theta_r,
    which differs from point to point, counts with no more than a few times the slope of the data
    themselves (`_view_limit`). And comparisons of models add `log_determinant`: chi2 + ln det C is
    -2 ln of the likelihood, in which a covariance that is too large costs more than it saves.
    `repeatable`: the points may be repeated, so that an error that one of them alone has is shared
    as well. Raises `ValueError` where `u_random` is not stated.
    """
    m = measurements
    if m.u_random is None:
        raise ValueError("u_random is not stated; allowed: a u_random in 1/sr for every point")
    groups, second_order = _shifts(m, brdf)
    variance = np.square(m.u_random) + np.sum(np.square(second_order), axis=0)
    rows: list[IntArray] = []
    columns: list[IntArray] = []
    shifts: list[FloatArray] = []
    names: list[str] = []
    for name, shift, group in groups:
        single, row, column, labels = _columns(shift, group, 1 if repeatable else 2)
        variance = variance + np.square(single)
        rows.append(row)
        columns.append(len(names) + column)
        shifts.append(shift[row])
        names += [f"{name}{label}" for label in labels]
    places = np.concatenate(rows), np.concatenate(columns)
    common = _matrix(np.concatenate(shifts), places, (m.size, len(names)))
    return Covariance(variance, common, tuple(_numbered(names)))


def contributions(measurements: Measurements, brdf: Brdf) -> dict[str, FloatArray]:
    """Standard uncertainty (N,) in 1/sr of each point by each shared error, and by the angles.

    As in `full_covariance`; errors of one name are combined, as are those of all angles, which are
    under `ANGLES`.
    """
    groups, second_order = _shifts(measurements, brdf)
    found: dict[str, FloatArray] = {ANGLES: np.sqrt(np.sum(np.square(second_order), axis=0))}
    for number, (name, shift, _) in enumerate(groups):
        key = ANGLES if number < len(second_order) else name
        found[key] = np.hypot(found.get(key, 0.0), shift)
    return found


def _shifts(
    m: Measurements, brdf: Brdf
) -> tuple[list[tuple[str, FloatArray, IntArray | FloatArray]], list[FloatArray]]:
    """Name, shift (N,) in 1/sr by one u, and group (N,) of each error; those of angles come first.

    Then the second-order contributions of the angles, (N,) in 1/sr each.
    """
    f = brdf(m.geometry)
    unlimited, limit = np.full(m.size, np.inf), _view_limit(m)
    angles: tuple[tuple[str, dict[str, float], FloatArray, IntArray | FloatArray], ...] = (
        (VIEW, {"theta_r": m.u_theta_r_deg}, limit, m.theta_r_deg),
        ("theta_i, lamp setting", {"theta_i": m.u_theta_i_deg}, unlimited, m.lamp_setting),
        ("dphi, lamp setting", {"dphi": m.u_dphi_deg}, unlimited, m.lamp_setting),
    )
    groups = [
        (name, np.clip(angle_sensitivity(m, brdf, **u), -most, most), group)
        for name, u, most, group in angles
    ]
    for error in m.shared:
        theta_i, theta_r, dphi = error.angles_deg
        turned = angle_sensitivity(m, brdf, theta_i=theta_i, theta_r=theta_r, dphi=dphi)
        groups.append((error.name, f * error.u_relative + turned, error.group))
    if m.free_levels:
        groups.append((LAMP_LEVEL, _U_UNKNOWN_LEVEL * f, m.lamp_setting))
    second_order = [np.clip(_second_order_u(m, brdf, **u), -most, most) for _, u, most, _ in angles]
    return groups, second_order


def _matrix(
    values: FloatArray, places: tuple[IntArray, IntArray], shape: tuple[int, int]
) -> Columns:
    """Matrix with values at these rows and columns, sparse where a dense one would be large."""
    if shape[0] * shape[1] > _MAX_DENSE:
        from scipy.sparse import csr_array  # heavy, and for long scans only

        return csr_array((values, places), shape=shape)
    matrix = np.zeros(shape)
    matrix[places] = values
    return matrix


def _columns(
    shift: FloatArray, group: IntArray | FloatArray, least: int
) -> tuple[FloatArray, IntArray, IntArray, list[str]]:
    """Shifts (N,) of points in smaller groups; rows, columns and labels of those of `least` points.

    The points of a group have the same number in `group`, or the same angle in degrees.
    """
    values, member, count = np.unique(group, return_inverse=True, return_counts=True)
    single = count[member] < least
    several = np.flatnonzero((count >= least) & (np.bincount(member, np.abs(shift)) > 0))
    column = np.full(values.size, -1)
    column[several] = np.arange(several.size)
    rows = np.flatnonzero(column[member] >= 0)
    if np.issubdtype(group.dtype, np.floating):
        labels = [f" at {value:g}°" for value in values[several]]
    else:
        labels = [f" {value + 1}" if values.size > 1 else "" for value in values[several]]
    return np.where(single, shift, 0.0), rows, column[member[rows]], labels


def _numbered(names: list[str]) -> Iterator[str]:
    """Names made unique: those that occur several times get a number each."""
    total, so_far = Counter(names), Counter[str]()
    for name in names:
        so_far[name] += 1
        yield name if total[name] == 1 else f"{name} {so_far[name]}"


def _view_limit(m: Measurements) -> FloatArray:
    """Largest credible shift (N,) in 1/sr of each point by one u of theta_r.

    A few times the steepest change of the data to a neighbour in the same sweep: a lobe that is
    resolved is no steeper between the points. Infinite for a point without neighbours, and at
    least the noise, which hides smaller shifts.
    """
    limit = np.full(m.size, np.inf)
    if not m.u_theta_r_deg or m.u_random is None:
        return limit
    views = signed_view(m)
    for sweep in sweeps(m):
        step = np.maximum(np.abs(np.diff(views[sweep.points])), _LEAST_STEP_DEG)
        slope = np.abs(np.diff(m.brdf[sweep.points])) / step
        steepest = np.maximum(np.r_[0.0, slope], np.r_[slope, 0.0])
        limit[sweep.points] = _STEEPER * m.u_theta_r_deg * steepest
    return np.asarray(np.maximum(limit, m.u_random))


def angle_sensitivity(m: Measurements, smooth: Brdf, **u_angle: FloatArray | float) -> FloatArray:
    """Shift (N,) of `smooth` in 1/sr by one u of an angle: half its change from -u to +u.

    `u_angle`: theta_i, theta_r or dphi, or those that one error changes together, (N,) or a single
    number each, in degrees. `smooth` gives BRDF of the geometry's shape. Steps of u itself include
    a kink as far as u reaches over it. Beyond 90 degrees there is no geometry: the change on the
    other side then counts alone.
    """
    if not any(np.any(u) for u in u_angle.values()):
        return np.zeros(m.size)
    up, up_step = _moved(m, 1, **u_angle)
    down, down_step = _moved(m, -1, **u_angle)
    return np.asarray((smooth(up) - smooth(down)) / (up_step + down_step))


def _second_order_u(m: Measurements, smooth: Brdf, **u_angle: float) -> FloatArray:
    """Second-order contribution (N,) of an angle's uncertainty (GUM 5.1.2, note).

    A normal error of u adds (d2f/dx2) u^2 / 2 times a square of mean square 3.
    """
    if not any(u_angle.values()):
        return np.zeros(m.size)
    (up, up_step), (down, down_step) = _moved(m, 1, **u_angle), _moved(m, -1, **u_angle)
    both = up_step * down_step  # beyond 90 degrees there is no second side to compare with
    return np.asarray(both * np.sqrt(3) * (smooth(up) + smooth(down) - 2 * smooth(m.geometry)) / 2)


def _moved(
    m: Measurements,
    sign: int,
    *,
    theta_i: FloatArray | float = 0.0,
    theta_r: FloatArray | float = 0.0,
    dphi: FloatArray | float = 0.0,
) -> tuple[Geometry, FloatArray]:
    """Geometry with the angles moved, and (N,): 1 where that is possible, 0 elsewhere."""
    new_i, new_r = m.theta_i_deg + sign * theta_i, m.theta_r_deg + sign * theta_r
    inside = (np.abs(new_i) <= 90) & (np.abs(new_r) <= 90)
    new_i, new_r = np.where(inside, new_i, m.theta_i_deg), np.where(inside, new_r, m.theta_r_deg)
    # A lamp that passes the normal is on the other side: dphi changes by 180.
    new_dphi = m.dphi_deg + sign * dphi + np.where(new_i < 0, 180.0, 0.0)
    moved = Geometry.from_degrees(theta_i=np.abs(new_i), theta_r=new_r, dphi=new_dphi)
    return moved, inside.astype(np.float64)
