"""Sweeps of a report: points along the axis that the scan sweeps, with lines of the models."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.report.data import ReportData
from analysis.report.swept_axis import AXES, SAME_ANGLE_DEG, VIEW, SweptAxis
from instrument.geometry import BoolArray, FloatArray, IntArray

_GRID_STEP_DEG = 1.0
# Another axis than the view angle is taken where it needs so many times fewer series.
_FEWER = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class PlottedSweep:
    """Points (P,) of one series in one panel by rising angle, with lines of the models.

    panel, series: numbers of the panel and of the series within the run; panel_deg, series_deg:
        their angles in degrees.
    at: index of each point among those of the run.
    x_deg: angle of each point on the swept axis.
    value, u: BRDF in 1/sr, or radiance in counts/s where there is no white tile.
    residual: in u, less the errors that points share. deviation, u_deviation: difference from the
        line of the first model and its u, in % of the line.
    lines: in the unit of the values, at `line_deg` (M,), one for each of `ReportData.plotted`;
        without a tile each is scaled to the points.
    unit: value that the chart of the shape divides by: that at theta_r = 0, or 1.
    """

    axis: SweptAxis
    panel: int
    series: int
    panel_deg: float
    series_deg: float
    at: IntArray
    x_deg: FloatArray
    value: FloatArray
    u: FloatArray
    flagged: BoolArray
    fitted: BoolArray
    residual: FloatArray
    deviation: FloatArray
    u_deviation: FloatArray
    line_deg: FloatArray
    lines: tuple[FloatArray, ...]
    unit: float

    @property
    def in_plane(self) -> bool:
        """True if lamp and camera are in one plane throughout."""
        return bool(self.axis.side) and abs(self.panel_deg) < SAME_ANGLE_DEG

    @property
    def shown_panel_deg(self) -> float:
        """Angle of the panel, 0 to 360 degrees, rounded."""
        return round(self.panel_deg, 1) % 360.0

    @property
    def shown_series_deg(self) -> float:
        """Angle of the series in degrees, rounded."""
        return round(self.series_deg, 1)


def group_sweeps(data: ReportData) -> tuple[PlottedSweep, ...]:
    """Group the points with finite values into sweeps along the axis that makes the fewest."""
    value, _ = data.value_and_u
    angles = (data.theta_i_deg, data.dphi_deg, data.theta_r_deg)
    usable = np.logical_and.reduce([np.isfinite(column) for column in (value, *angles)])
    places = [_Places.of(axis, angles, usable) for axis in AXES]
    fewest = min(places, key=lambda found: len(found.groups))
    view = places[AXES.index(VIEW)]
    found = fewest if _FEWER * len(fewest.groups) < len(view.groups) else view
    sweeps = [_sweep(data, found, panel, series) for panel, series in found.groups]
    return tuple(sorted(sweeps, key=lambda s: (s.shown_panel_deg, s.series_deg)))


@dataclass(frozen=True, slots=True)
class _Places:
    """Places of all points on an axis: x (N,) in degrees, numbers of panel and series (N,)."""

    axis: SweptAxis
    x_deg: FloatArray
    panel_deg: FloatArray
    panel: IntArray
    series_deg: FloatArray
    series: IntArray
    groups: Sequence[tuple[int, int]]

    @classmethod
    def of(
        cls, axis: SweptAxis, angles: tuple[FloatArray, FloatArray, FloatArray], usable: BoolArray
    ) -> _Places:
        x, series_deg, panel_deg = axis.place(*angles)
        series, panel = _settings(series_deg, usable), _settings(panel_deg, usable)
        groups = sorted(set(zip(panel[usable].tolist(), series[usable].tolist(), strict=True)))
        return cls(axis, x, panel_deg, panel, series_deg, series, groups)


def _sweep(data: ReportData, places: _Places, panel: int, series: int) -> PlottedSweep:
    at = np.flatnonzero((places.panel == panel) & (places.series == series))
    at = at[np.argsort(places.x_deg[at], kind="stable")]
    x, good = places.x_deg[at], ~data.flagged[at]
    value, u = (column[at] for column in data.value_and_u)
    u = np.where(np.isfinite(u) & (u > 0), u, 0.0)
    panel_deg, series_deg = np.median(places.panel_deg[at]), np.median(places.series_deg[at])
    grid = _grid(x)
    lines = _lines(data, places.axis, grid, float(series_deg), float(panel_deg))
    if not data.absolute:
        lines = [_scaled(line, grid, x[good], value[good]) for line in lines]
    deviation, u_deviation = _deviation(value, u, lines, np.searchsorted(grid, x))
    measured = (grid >= x[0]) & (grid <= x[-1])
    return PlottedSweep(
        axis=places.axis,
        panel=panel,
        series=series,
        panel_deg=float(panel_deg),
        series_deg=float(series_deg),
        at=at,
        x_deg=x,
        value=value,
        u=u,
        flagged=data.flagged[at],
        fitted=np.asarray(data.fitted, dtype=bool)[at],
        residual=_residuals(data)[at],
        deviation=deviation,
        u_deviation=u_deviation,
        line_deg=grid[measured],
        lines=tuple(line[measured] for line in lines),
        unit=_at_normal(x[good], value[good], grid, lines) if places.axis is VIEW else 1.0,
    )


def _settings(angle_deg: FloatArray, usable: BoolArray) -> IntArray:
    """Number of each usable angle's setting, counted from the smallest angle; -1 elsewhere."""
    at = np.flatnonzero(usable)
    at = at[np.argsort(angle_deg[at], kind="stable")]
    numbers = np.full(len(angle_deg), -1, dtype=np.int64)
    numbers[at[:1]] = 0
    numbers[at[1:]] = np.cumsum(np.diff(angle_deg[at]) > SAME_ANGLE_DEG)
    return numbers


def _residuals(data: ReportData) -> FloatArray:
    residual = np.full(len(data.theta_i_deg), np.nan)
    chosen = next((c for c in data.candidates if c.chosen), None)
    if chosen is not None and chosen.residuals is not None:
        residual[np.asarray(data.fitted, dtype=bool)] = chosen.residuals
    return np.where(np.isfinite(residual), residual, np.nan)


def _grid(x_deg: FloatArray) -> FloatArray:
    """Angles at which the lines are computed: those measured, whole degrees between, and zero."""
    between = np.arange(np.ceil(x_deg[0]), x_deg[-1], _GRID_STEP_DEG)
    return np.unique(np.concatenate([x_deg, between, [0.0]]))


def _lines(
    data: ReportData, axis: SweptAxis, grid: FloatArray, series_deg: float, panel_deg: float
) -> list[FloatArray]:
    """Values of the plotted models along a sweep; radiance is proportional to BRDF cos(theta_i)."""
    fixed = np.full_like(grid, series_deg), np.full_like(grid, panel_deg)
    theta_i, dphi, theta_r = axis.angles(grid, *fixed)
    lines = [c.curve(theta_i, dphi, theta_r) for c in data.plotted if c.curve is not None]
    if not data.has_brdf:
        lines = [line * np.cos(np.radians(theta_i)) for line in lines]
    return [np.where(np.isfinite(line), line, np.nan) for line in lines]


def _scaled(line: FloatArray, grid: FloatArray, x_deg: FloatArray, value: FloatArray) -> FloatArray:
    """The line scaled to the points by the median ratio."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = value / np.interp(x_deg, grid, line)
    ratio = ratio[np.isfinite(ratio)]
    return line * (np.median(ratio) if len(ratio) else np.nan)


def _deviation(
    value: FloatArray, u: FloatArray, lines: list[FloatArray], at: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Difference of the values from the first line and their u, in % of the line; else NaN."""
    if not lines:
        return np.full_like(value, np.nan), np.full_like(value, np.nan)
    line = np.where(lines[0][at] > 0, lines[0][at], np.nan)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        found = 100.0 * (value / line - 1.0), 100.0 * u / line
    deviation, u_deviation = (np.where(np.isfinite(part), part, np.nan) for part in found)
    return deviation, u_deviation


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
