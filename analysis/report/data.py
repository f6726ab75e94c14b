"""Content of a report: plain values, ready to plot, and their grouping into sweeps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from instrument.geometry import BoolArray, FloatArray, IntArray
from instrument.record.reading import Preview

Rows = tuple[tuple[str, str], ...]

# BRDF in 1/sr as a function of theta_i_deg, dphi_deg and signed theta_r_deg (M,).
Curve = Callable[[float, float, FloatArray], FloatArray]

# Models plotted per sweep, the chosen one included.
MAX_LINES = 3

# Angles that differ by less are one setting of the lamp, or one plane of the camera.
_SAME_ANGLE_DEG = 0.25
_GRID_STEP_DEG = 1.0
_COLUMNS = (
    "dphi_deg", "theta_r_deg", "brdf", "u_brdf", "radiance", "u_radiance", "flags", "fitted",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Parameter:
    """A fitted parameter; `u` is None where the data do not determine it.

    `interval` is then its 95 % interval, in the same unit; None for a model that is not chosen.
    """

    name: str
    value: float
    u: float | None
    interval: tuple[float, float] | None
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A fitted model and its agreement with the data.

    residuals: (measured - model - errors that points share) / u of the points in the fit, in their
        order.
    curve: BRDF of the fitted model. agrees: the model agrees with the data.
    """

    name: str
    parameters: tuple[Parameter, ...]
    rms_relative: float
    reduced_chi2: float | None
    bic: float | None
    converged: bool
    chosen: bool
    agrees: bool = True
    message: str = ""
    residuals: FloatArray | None = None
    curve: Curve | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportData:
    """Content of a report. Arrays and `flags` have one entry per point (N,).

    theta_i_deg, dphi_deg, theta_r_deg: in degrees, theta_r signed.
    brdf, u_brdf: in 1/sr; NaN throughout where no white tile was measured.
    radiance, u_radiance: in counts/s.
    flags: empty for a good point. fitted: True for the points in the fit.
    verdict: the headline, then further sentences. verdict_kind: `adequate`, `none adequate`, `not
        identifiable`, or empty where nothing was fitted; sets the colour of the box.
    budget: rows of (component, median relative u in %, share of the variance in %).
    """

    title: str
    sample: str
    description: str
    verdict: tuple[str, ...]
    verdict_kind: str
    notes: tuple[str, ...]
    theta_i_deg: FloatArray
    dphi_deg: FloatArray
    theta_r_deg: FloatArray
    brdf: FloatArray
    u_brdf: FloatArray
    radiance: FloatArray
    u_radiance: FloatArray
    flags: tuple[str, ...]
    fitted: BoolArray
    candidates: tuple[Candidate, ...] = ()
    budget: tuple[tuple[str, float, float], ...] = ()
    previews: tuple[Preview, ...] = ()
    rig: Rows = ()
    devices: Rows = ()
    metadata: Rows = ()
    versions: Rows = ()
    times: Rows = ()

    def __post_init__(self) -> None:
        points, fitted = len(self.theta_i_deg), int(np.count_nonzero(self.fitted))
        for name in _COLUMNS:
            if (size := len(getattr(self, name))) != points:
                raise ValueError(f"{name}: {size} entries for {points} points")
        for c in self.candidates:
            if c.residuals is not None and len(c.residuals) != fitted:
                size = len(c.residuals)
                raise ValueError(f"{c.name}: {size} residuals for {fitted} points in the fit")

    @property
    def has_brdf(self) -> bool:
        """True if at least one point has a BRDF, relative to a white tile."""
        return bool(np.any(np.isfinite(self.brdf)))

    @property
    def value_and_u(self) -> tuple[FloatArray, FloatArray]:
        """BRDF (N,) and its u in 1/sr; without a white tile radiance and its u in counts/s."""
        if self.has_brdf:
            return self.brdf, self.u_brdf
        return self.radiance, self.u_radiance

    @property
    def flagged(self) -> BoolArray:
        """Boolean mask (N,) of the points with a flag."""
        return np.array([bool(flag) for flag in self.flags], dtype=bool)

    @property
    def ranked(self) -> tuple[Candidate, ...]:
        """The candidates by rising BIC, the chosen one first; those that failed come last."""

        def rank(c: Candidate) -> tuple[bool, bool, float]:
            bic = c.bic if c.bic is not None and np.isfinite(c.bic) else np.inf
            return not c.chosen, not c.converged, bic

        return tuple(sorted(self.candidates, key=rank))

    @property
    def plotted(self) -> tuple[Candidate, ...]:
        """The candidates that are plotted as lines: the chosen one and those next to it by BIC."""
        with_curve = [c for c in self.ranked if c.curve is not None and (c.chosen or c.converged)]
        return tuple(with_curve[:MAX_LINES])


@dataclass(frozen=True, slots=True, kw_only=True)
class PlottedSweep:
    """Points (P,) of one lamp direction in one plane by rising theta_r, with lines of the models.

    plane, incidence: numbers of the plane and of the lamp's angle within the run.
    dphi_deg: folded into -90 to 90, so that positive theta_r is always the lamp's side.
    value, u: BRDF in 1/sr, or radiance in counts/s where there is no white tile.
    lines: in the same unit, at `line_deg` (M,), one for each of `ReportData.plotted`; without a
        tile each is scaled to the points.
    at_normal: value at theta_r = 0, in the same unit.
    """

    plane: int
    incidence: int
    theta_i_deg: float
    dphi_deg: float
    theta_r_deg: FloatArray
    value: FloatArray
    u: FloatArray
    flagged: BoolArray
    fitted: BoolArray
    residual: FloatArray
    line_deg: FloatArray
    lines: tuple[FloatArray, ...]
    at_normal: float

    @property
    def in_plane(self) -> bool:
        """True if the camera moves in the plane of the lamp."""
        return abs(self.dphi_deg) < _SAME_ANGLE_DEG

    @property
    def plane_deg(self) -> float:
        """Azimuth of the side of positive theta_r from the lamp's, 0 to 360 degrees, rounded."""
        return round(self.dphi_deg, 1) % 360.0


def group_sweeps(data: ReportData) -> tuple[PlottedSweep, ...]:
    """Group the points with finite values into sweeps: one per lamp direction and plane."""
    value, _ = data.value_and_u
    dphi_deg, theta_r_deg = _folded(data.dphi_deg, data.theta_r_deg)
    usable = np.isfinite(value) & np.isfinite(data.theta_i_deg)
    usable &= np.isfinite(dphi_deg) & np.isfinite(theta_r_deg)
    incidence = _settings(data.theta_i_deg, usable)
    plane = _settings(dphi_deg, usable)
    sweeps = []
    for p, i in sorted(set(zip(plane[usable], incidence[usable], strict=True))):
        at = np.flatnonzero((plane == p) & (incidence == i))
        at = at[np.argsort(theta_r_deg[at], kind="stable")]
        dphi = float(np.median(dphi_deg[at]))
        sweeps.append(_sweep(data, int(p), int(i), at, dphi, theta_r_deg[at]))
    return tuple(sorted(sweeps, key=lambda s: (s.plane_deg, s.theta_i_deg)))


def _sweep(
    data: ReportData, plane: int, incidence: int, at: IntArray, dphi_deg: float, theta_r: FloatArray
) -> PlottedSweep:
    value, u = (column[at] for column in data.value_and_u)
    theta_i_deg, good = float(np.median(data.theta_i_deg[at])), ~data.flagged[at]
    grid = _grid(theta_r)
    lines = [c.curve(theta_i_deg, dphi_deg, grid) for c in data.plotted if c.curve is not None]
    if not data.has_brdf:
        lines = [_scaled(line, grid, theta_r[good], value[good]) for line in lines]
    lines = [np.where(np.isfinite(line), line, np.nan) for line in lines]
    measured = (grid >= theta_r[0]) & (grid <= theta_r[-1])
    return PlottedSweep(
        plane=plane,
        incidence=incidence,
        theta_i_deg=theta_i_deg,
        dphi_deg=dphi_deg,
        theta_r_deg=theta_r,
        value=value,
        u=np.where(np.isfinite(u) & (u > 0), u, 0.0),
        flagged=data.flagged[at],
        fitted=np.asarray(data.fitted, dtype=bool)[at],
        residual=_residuals(data)[at],
        line_deg=grid[measured],
        lines=tuple(line[measured] for line in lines),
        at_normal=_at_normal(theta_r[good], value[good], grid, lines),
    )


def _folded(dphi_deg: FloatArray, theta_r_deg: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same directions with dphi in -90 to 90 degrees; theta_r changes its sign if needed."""
    with np.errstate(invalid="ignore"):
        around = np.mod(dphi_deg + 90.0 - _SAME_ANGLE_DEG, 360.0) - 90.0 + _SAME_ANGLE_DEG
        other = around > 90.0 + _SAME_ANGLE_DEG
    return np.where(other, around - 180.0, around), np.where(other, -theta_r_deg, theta_r_deg)


def _settings(angle_deg: FloatArray, usable: BoolArray) -> IntArray:
    """Number of each usable angle's setting, counted from the smallest angle; -1 elsewhere."""
    at = np.flatnonzero(usable)
    at = at[np.argsort(angle_deg[at], kind="stable")]
    numbers = np.full(len(angle_deg), -1, dtype=np.int64)
    numbers[at[:1]] = 0
    numbers[at[1:]] = np.cumsum(np.diff(angle_deg[at]) > _SAME_ANGLE_DEG)
    return numbers


def _residuals(data: ReportData) -> FloatArray:
    residual = np.full(len(data.theta_i_deg), np.nan)
    chosen = next((c for c in data.candidates if c.chosen), None)
    if chosen is not None and chosen.residuals is not None:
        residual[np.asarray(data.fitted, dtype=bool)] = chosen.residuals
    return np.where(np.isfinite(residual), residual, np.nan)


def _grid(theta_r_deg: FloatArray) -> FloatArray:
    """Angles at which the lines are computed: those measured, whole degrees between, and zero."""
    between = np.arange(np.ceil(theta_r_deg[0]), theta_r_deg[-1], _GRID_STEP_DEG)
    return np.unique(np.concatenate([theta_r_deg, between, [0.0]]))


def _scaled(
    line: FloatArray, grid: FloatArray, theta_r_deg: FloatArray, value: FloatArray
) -> FloatArray:
    """The line scaled to the points by the median ratio."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = value / np.interp(theta_r_deg, grid, line)
    ratio = ratio[np.isfinite(ratio)]
    return line * (np.median(ratio) if len(ratio) else np.nan)


def _at_normal(
    theta_r_deg: FloatArray, value: FloatArray, grid: FloatArray, lines: list[FloatArray]
) -> float:
    """Measured value at theta_r = 0, interpolated; else that of the model; else NaN."""
    if len(value) and theta_r_deg[0] <= 0.0 <= theta_r_deg[-1]:
        found = float(np.interp(0.0, theta_r_deg, value))
    elif lines:
        found = float(lines[0][np.searchsorted(grid, 0.0)])
    else:
        found = float("nan")
    return found if found > 0.0 else float("nan")
