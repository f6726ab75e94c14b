"""What a report shows: plain values, ready to draw, and how they fall into sweeps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from instrument.geometry import BoolArray, FloatArray, IntArray
from instrument.record.reading import Preview

Rows = tuple[tuple[str, str], ...]

# BRDF in 1/sr of theta_i_deg, dphi_deg and an array of signed theta_r_deg.
Curve = Callable[[float, float, FloatArray], FloatArray]

# A sweep's lines: the chosen model and at most this many runners-up.
MOST_LINES = 3

# Angles closer together than this are one setting of the lamp or one plane of the camera.
_SAME_ANGLE_DEG = 0.25
_GRID_STEP_DEG = 1.0


@dataclass(frozen=True, slots=True)
class Parameter:
    """A fitted value; `u` is None where the data do not determine it.

    `interval` then says where it may lie (95 %), in the same unit.
    """

    name: str
    value: float
    u: float | None
    interval: tuple[float, float] | None
    unit: str


@dataclass(frozen=True, slots=True)
class Candidate:
    """A model that was fitted, and how well it did.

    `residuals` are (measured - model - errors that points share) / u of the points that entered
    the fit, in their order.
    `curve` gives the model's BRDF in 1/sr with the fitted parameters.
    """

    name: str
    parameters: tuple[Parameter, ...]
    rms_relative: float
    reduced_chi2: float | None
    bic: float | None
    converged: bool
    chosen: bool
    message: str = ""
    residuals: FloatArray | None = None
    curve: Curve | None = None


@dataclass(frozen=True, slots=True)
class ReportData:
    """All that a report says. Angles in degrees with theta_r signed; one entry a point in each.

    `brdf` (1/sr) is NaN throughout where no white tile was measured; `radiance` is in counts/s.
    `flags` are empty for a point with nothing wrong; `fitted` marks the points that entered the
    fit. `verdict` begins with the headline; `verdict_kind` is `adequate`, `none adequate`,
    `not identifiable`, or empty where nothing was fitted, and sets the colour of its box.
    `budget` rows are (component, median relative u in %, share of the variance in %).
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
    versions: Rows = ()
    times: Rows = ()

    def __post_init__(self) -> None:
        points = len(self.theta_i_deg)
        for name in (
            *("dphi_deg", "theta_r_deg", "brdf", "u_brdf", "radiance", "u_radiance"),
            *("flags", "fitted"),
        ):
            if len(getattr(self, name)) != points:
                raise ValueError(f"{name}: {len(getattr(self, name))} entries for {points} points")
        entered = int(np.count_nonzero(self.fitted))
        for candidate in self.candidates:
            if candidate.residuals is not None and len(candidate.residuals) != entered:
                raise ValueError(
                    f"{candidate.name}: {len(candidate.residuals)} residuals for {entered} "
                    "points in the fit"
                )

    @property
    def has_brdf(self) -> bool:
        """Whether a white tile tied the scale down for at least one point."""
        return bool(np.any(np.isfinite(self.brdf)))

    @property
    def flagged(self) -> BoolArray:
        """Points with something wrong."""
        return np.array([bool(flag) for flag in self.flags], dtype=bool)

    @property
    def ranked(self) -> tuple[Candidate, ...]:
        """The candidates, the chosen one first and then by BIC; those without one come last."""

        def rank(candidate: Candidate) -> tuple[bool, bool, float]:
            bic = candidate.bic if candidate.bic is not None else np.inf
            return (
                not candidate.chosen,
                not candidate.converged,
                bic if np.isfinite(bic) else np.inf,
            )

        return tuple(sorted(self.candidates, key=rank))

    @property
    def drawn(self) -> tuple[Candidate, ...]:
        """The candidates whose lines are drawn: the chosen one and its runners-up."""
        with_curve = [c for c in self.ranked if c.curve is not None and (c.chosen or c.converged)]
        return tuple(with_curve[:MOST_LINES])


@dataclass(frozen=True, slots=True)
class Sweep:
    """The points of one lamp direction in one plane, by increasing theta_r, with models' lines.

    `plane` and `incidence` number the planes and the lamp's angles of the whole run.
    `dphi_deg` is folded into -90..90, so that positive theta_r is always the lamp's side.
    `value` and `u` are BRDF in 1/sr, or radiance in counts/s where there is no white tile.
    `lines` are in the same unit at `line_deg`, one for each of `ReportData.drawn`; without a tile
    each is scaled to the points. `at_normal` is the value at theta_r = 0.
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
        """Whether the camera passes through the lamp's own plane."""
        return abs(self.dphi_deg) < _SAME_ANGLE_DEG

    @property
    def plane_deg(self) -> float:
        """Azimuth of the positive side from the lamp's, 0-360, in whole tenths."""
        return round(self.dphi_deg, 1) % 360.0


def sweeps_of(data: ReportData) -> tuple[Sweep, ...]:
    """The points that can be drawn, one sweep for each lamp direction in each plane."""
    value, _ = _shown(data)
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
        sweeps.append(_sweep(data, (int(p), int(i)), at, dphi, theta_r_deg[at]))
    return tuple(sorted(sweeps, key=lambda s: (s.plane_deg, s.theta_i_deg)))


def _sweep(
    data: ReportData,
    numbers: tuple[int, int],
    at: IntArray,
    dphi_deg: float,
    theta_r: FloatArray,
) -> Sweep:
    value, u = (column[at] for column in _shown(data))
    theta_i_deg, good = float(np.median(data.theta_i_deg[at])), ~data.flagged[at]
    grid = _grid(theta_r)
    lines = [c.curve(theta_i_deg, dphi_deg, grid) for c in data.drawn if c.curve is not None]
    if not data.has_brdf:
        lines = [_scaled(line, grid, theta_r[good], value[good]) for line in lines]
    lines = [np.where(np.isfinite(line), line, np.nan) for line in lines]
    measured = (grid >= theta_r[0]) & (grid <= theta_r[-1])
    return Sweep(
        plane=numbers[0],
        incidence=numbers[1],
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


def _shown(data: ReportData) -> tuple[FloatArray, FloatArray]:
    return (data.brdf, data.u_brdf) if data.has_brdf else (data.radiance, data.u_radiance)


def _folded(dphi_deg: FloatArray, theta_r_deg: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same directions with dphi in -90..90, where theta_r changes its sign if need be."""
    with np.errstate(invalid="ignore"):
        around = np.mod(dphi_deg + 90.0 - _SAME_ANGLE_DEG, 360.0) - 90.0 + _SAME_ANGLE_DEG
        other = around > 90.0 + _SAME_ANGLE_DEG
    return np.where(other, around - 180.0, around), np.where(other, -theta_r_deg, theta_r_deg)


def _settings(angle_deg: FloatArray, usable: BoolArray) -> IntArray:
    """Number of the setting that each usable angle belongs to, from the smallest; -1 elsewhere."""
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
    """Where the lines are worked out: the measured angles, whole degrees between, and zero."""
    between = np.arange(np.ceil(theta_r_deg[0]), theta_r_deg[-1], _GRID_STEP_DEG)
    return np.unique(np.concatenate([theta_r_deg, between, [0.0]]))


def _scaled(
    line: FloatArray, grid: FloatArray, theta_r_deg: FloatArray, value: FloatArray
) -> FloatArray:
    """The line made to pass through the middle of the points, where their scale is unknown."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = value / np.interp(theta_r_deg, grid, line)
    ratio = ratio[np.isfinite(ratio)]
    return line * (np.median(ratio) if len(ratio) else np.nan)


def _at_normal(
    theta_r_deg: FloatArray, value: FloatArray, grid: FloatArray, lines: list[FloatArray]
) -> float:
    """The measured value at theta_r = 0, between its neighbours; else the model's; else NaN."""
    if len(value) and theta_r_deg[0] <= 0.0 <= theta_r_deg[-1]:
        found = float(np.interp(0.0, theta_r_deg, value))
    elif lines:
        found = float(lines[0][np.searchsorted(grid, 0.0)])
    else:
        found = float("nan")
    return found if found > 0.0 else float("nan")
