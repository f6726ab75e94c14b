"""Charts of the report against the swept angle.

Each series has the same colour, marker and line style in every chart, so that the charts can be
read without colour. Texts from the record appear in captions only, never in a chart.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.report.figures.value_axis import set_symmetric_axis, set_value_axis
from analysis.report.style import (
    BAND,
    GREY,
    INK,
    NARROW_IN,
    WIDTH_IN,
    Dashes,
    Drawing,
    Marks,
    style_of,
)
from analysis.report.sweeps import PlottedSweep
from analysis.report.swept_axis import AZIMUTH, VIEW
from instrument.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

# More would be too small to read and slow to draw.
MAX_SWEEPS = 12
MAX_SERIES = 12
MAX_PANELS = 6

_LEGEND_COLUMNS, _NARROW_COLUMNS = 4, 2
_RUNNER_UP: tuple[Dashes, ...] = ((0, (5, 2)), (0, (1.5, 1.5)))
_HEIGHTS = (3.2, 1.1, 1.0)  # of the values, the deviations and the residuals
_LEAST_DEVIATION = 0.1  # %


def sweep_label(sweep: PlottedSweep, panels: int) -> str:
    """Label of a sweep: the angle of its series, and of its panel where there are several."""
    shown = panels > 1 or not (sweep.in_plane or sweep.axis is AZIMUTH)
    panel = f", {sweep.axis.panel} = {sweep.shown_panel_deg:g}°" if shown else ""
    return f"{sweep.axis.series} = {sweep.shown_series_deg:g}°{panel}"


def shape_drawings(
    sweeps: Sequence[PlottedSweep], quantity: str, *, narrow: bool = False
) -> list[Drawing]:
    """Values against the swept angle above their residuals: one column per panel, two a chart.

    Against the view angle, the values are relative to that at theta_r = 0. `narrow`: for a phone,
    one panel a chart.
    """
    shown = thinned_series(sweeps)
    panels = panels_of(shown)
    most = 1 if narrow else 2
    pairs = [panels[i : i + most] for i in range(0, len(panels), most)]
    return [_shape_drawing(pair, shown, quantity, narrow) for pair in pairs]


def brdf_drawing(sweeps: Sequence[PlottedSweep], quantity: str, *, narrow: bool = False) -> Drawing:
    """Measured quantity of each sweep in a panel of its own, with lines of the models."""
    shown = thinned(sweeps)
    columns = min(len(shown), 4 if len(shown) in (4, 7, 8) or len(shown) > 9 else 3)
    columns = 1 if narrow else columns
    rows = -(-len(shown) // columns)
    left = 0.9 if max(float(np.max(np.abs(s.value))) for s in shown) < 1e3 else 1.05

    def draw(figure: Figure) -> list[Marks]:
        grid = {"hspace": 0.4, "wspace": 0.08, **margins(figure, left, 0.15, 0.36, 0.58)}
        axes = figure.subplots(
            rows, columns, sharex=True, sharey=True, squeeze=False, gridspec_kw=grid
        )
        marks = []
        for ax, sweep in zip(axes.flat, shown, strict=False):
            marks.append(_brdf_panel(ax, sweep))
            label = sweep_label(sweep, len(panels_of(sweeps)))
            ax.set_title(label, color=INK, loc="left", pad=9)
        for ax in axes.flat[len(shown) :]:
            ax.set_visible(False)
        set_value_axis(axes[0, 0], [(s, 1.0) for s in shown])
        _set_angles(axes[0, 0], shown, narrow=True)
        for ax in axes.flat[max(len(shown) - columns, 0) : len(shown)]:
            ax.set_xlabel(shown[0].axis.label)
            ax.tick_params(labelbottom=True)
        for ax in axes[:, 0]:
            ax.set_ylabel(quantity)
        return marks

    return Drawing(0.9 + 2.2 * rows, draw, NARROW_IN if narrow else WIDTH_IN)


def thinned(sweeps: Sequence[PlottedSweep]) -> list[PlottedSweep]:
    """At most `MAX_SWEEPS` of the sweeps, evenly selected."""
    kept = _evenly(range(len(sweeps)), MAX_SWEEPS)
    return [sweeps[i] for i in kept]


def thinned_series(sweeps: Sequence[PlottedSweep]) -> list[PlottedSweep]:
    """The sweeps of at most `MAX_SERIES` series and `MAX_PANELS` panels, evenly selected."""
    series = _evenly(sorted({s.series for s in sweeps}), MAX_SERIES)
    panels = _evenly(list(dict.fromkeys(s.panel for s in sweeps)), MAX_PANELS)
    return [s for s in sweeps if s.series in series and s.panel in panels] or list(sweeps[:1])


def _evenly(numbers: Sequence[int], most: int) -> list[int]:
    chosen = np.linspace(0, len(numbers) - 1, min(most, len(numbers))).round().astype(int)
    return [numbers[i] for i in chosen]


def panels_of(sweeps: Sequence[PlottedSweep]) -> list[list[PlottedSweep]]:
    """The sweeps grouped by panel."""
    panels: dict[int, list[PlottedSweep]] = {}
    for sweep in sweeps:
        panels.setdefault(sweep.panel, []).append(sweep)
    return list(panels.values())


def margins(
    figure: Figure, left: float, right: float, top: float, bottom: float
) -> dict[str, float]:
    """Margins in inches as fractions of the figure."""
    width, height = figure.get_size_inches()
    return {
        "left": left / width,
        "right": 1.0 - right / width,
        "top": 1.0 - top / height,
        "bottom": bottom / height,
    }


def _shape_drawing(
    panels: Sequence[Sequence[PlottedSweep]],
    sweeps: Sequence[PlottedSweep],
    quantity: str,
    narrow: bool,
) -> Drawing:
    residuals = any(np.any(np.isfinite(s.residual)) for s in sweeps)
    rows = (1 + any(s.lines for s in sweeps)) + residuals
    columns = 1 if narrow else min(len(panels_of(sweeps)), 2)
    titled = len(panels_of(sweeps)) > 1 or not panels[0][0].in_plane
    legend_in = 0.24 * _legend_shape(sweeps, narrow)[0]
    view = sweeps[0].axis is VIEW

    def draw(figure: Figure) -> list[Marks]:
        top = legend_in + (0.68 if titled else 0.44)
        grid: dict[str, Any] = {"height_ratios": _HEIGHTS[:rows], "hspace": 0.12, "wspace": 0.06}
        grid |= margins(figure, 0.9, 0.15, top, 0.58)
        axes = figure.subplots(
            rows, columns, sharex=True, sharey="row", squeeze=False, gridspec_kw=grid
        )
        marks: list[Marks] = []
        for column, panel in enumerate(panels):
            marks += _shape_panel(axes[0, column], panel, narrow or columns > 1)
            if titled:
                _panel_title(axes[0, column], panel[0])
            if rows > 1:
                marks += _deviation_panel(axes[1, column], panel, sweeps)
            if residuals:
                marks += _residual_panel(axes[-1, column], panel, sweeps)
            _angle_axis(axes[-1, column], panel[0], sweeps, narrow or columns > 1)
        for ax in axes[:, len(panels) :].flat:
            ax.set_visible(False)
        set_value_axis(axes[0, 0], [(s, s.unit) for s in sweeps if np.isfinite(s.unit)])
        labels = ("L(θᵣ) / L(0)" if view else quantity, "deviation (%)", "residual / u")
        for ax, label in zip(axes[:, 0], labels, strict=False):
            ax.set_ylabel(label)
        figure.align_ylabels(axes[:, 0])
        _legend(figure, sweeps, narrow)
        return marks

    height = sum(_HEIGHTS[:rows]) * 1.02 + 0.75 + legend_in + (0.24 if titled else 0.0)
    return Drawing(height, draw, NARROW_IN if narrow else WIDTH_IN)


def _shape_panel(ax: Axes, panel: Sequence[PlottedSweep], small: bool) -> list[Marks]:
    marks = []
    for sweep in panel:
        if not np.isfinite(sweep.unit):
            continue
        if sweep.lines:
            _line(ax, sweep.line_deg, sweep.lines[0] / sweep.unit, sweep.series)
        marks.append(_points(ax, sweep, sweep.value / sweep.unit, sweep.u / sweep.unit))
        if sweep.in_plane:
            fixed = "lamp" if sweep.axis is VIEW else "camera"
            name = "" if len(panel) > 8 else " " if small else f"{fixed} "
            _fixed_mark(ax, sweep, name)
    return marks


def _panel_title(ax: Axes, sweep: PlottedSweep) -> None:
    axis, other = sweep.axis, (sweep.panel_deg + 180.0) % 360.0
    title = f"{axis.panel} = {sweep.shown_panel_deg:g}°"
    if axis.side:
        title += f" (negative {axis.symbol}: Δφ = {round(other, 1):g}°)"
    ax.set_title(title, color=INK, loc="left", pad=19)


def _deviation_panel(
    ax: Axes, panel: Sequence[PlottedSweep], sweeps: Sequence[PlottedSweep]
) -> list[Marks]:
    """Deviations of the points from the line in %, with bars of u."""
    ax.axhline(0.0, color=GREY, linewidth=0.8, zorder=1)
    marks = [_points(ax, s, s.deviation, s.u_deviation, size=3.4) for s in panel]
    ends = [
        end[~s.flagged]
        for s in sweeps
        for end in (s.deviation - s.u_deviation, s.deviation + s.u_deviation)
    ]
    set_symmetric_axis(ax, ends, _LEAST_DEVIATION)
    return marks


def _residual_panel(
    ax: Axes, panel: Sequence[PlottedSweep], sweeps: Sequence[PlottedSweep]
) -> list[Marks]:
    ax.axhspan(-2.0, 2.0, color=BAND, zorder=0)
    ax.axhline(0.0, color=GREY, linewidth=0.8, zorder=1)
    for sweep in panel:
        colour, marker, _ = style_of(sweep.series)
        _line(ax, sweep.x_deg, sweep.residual, sweep.series, linewidth=0.6)
        ax.plot(sweep.x_deg, sweep.residual, ls="", ms=3.4, c=colour, marker=marker)
    if set_symmetric_axis(ax, [s.residual for s in sweeps], 3.5) < 8:
        ax.set_yticks([-2, 0, 2])
    return [Marks(ax, s.x_deg, s.residual, s.at) for s in panel]


def model_handles(names: Sequence[str]) -> list[Line2D]:
    """Entries of a legend for the models' lines in the panels of the BRDF, the chosen one first."""
    from matplotlib.lines import Line2D

    styles = [(INK, "-"), *((GREY, dashes) for dashes in _RUNNER_UP)]
    pairs = zip(names, styles, strict=False)
    return [Line2D([], [], c=c, ls=dashes, label=name) for name, (c, dashes) in pairs]


def _brdf_panel(ax: Axes, sweep: PlottedSweep) -> Marks:
    marks = _points(ax, sweep, sweep.value, sweep.u, size=3.8)
    for line, style in zip(sweep.lines[1:], _RUNNER_UP, strict=False):
        ax.plot(sweep.line_deg, line, color=GREY, linewidth=1.1, zorder=7, linestyle=style)
    if sweep.lines:
        ax.plot(sweep.line_deg, sweep.lines[0], color=INK, linewidth=1.3, zorder=8)
    if sweep.in_plane:
        _fixed_mark(ax, sweep, "")
    return marks


def _points(
    ax: Axes, sweep: PlottedSweep, value: FloatArray, u: FloatArray, size: float = 4.5
) -> Marks:
    """Plot filled markers for points in the fit, open ones for others, crosses on flagged ones."""
    colour, marker, _ = style_of(sweep.series)
    x, flagged = sweep.x_deg, sweep.flagged
    hollow = flagged | (~sweep.fitted & bool(np.any(sweep.fitted)))
    ax.vlines(x, value - u, value + u, color=colour, linewidth=1.0, zorder=4)
    plain: dict[str, Any] = {"ls": "", "marker": marker, "color": colour, "ms": size, "zorder": 5}
    ax.plot(x[~hollow], value[~hollow], **plain)
    if np.any(hollow):
        ax.plot(x[hollow], value[hollow], mfc="white", **plain)
    if np.any(flagged):
        ax.plot(x[flagged], value[flagged], ls="", marker="x", ms=8, c=INK, mew=1.2, zorder=6)
    return Marks(ax, x, value, sweep.at)


def _line(ax: Axes, x: FloatArray, y: FloatArray, series: int, linewidth: float = 1.5) -> None:
    colour, _, dashes = style_of(series)
    ax.plot(x, y, color=colour, linestyle=dashes, linewidth=linewidth, zorder=2)


def _fixed_mark(ax: Axes, sweep: PlottedSweep, name: str) -> None:
    """Mark above the panel the angle of what stands still; with a `name`, also write it."""
    colour = style_of(sweep.series)[0]
    at, above = sweep.series_deg, ax.get_xaxis_transform()
    ax.axvline(at, color=colour, linewidth=0.7, linestyle=(0, (1, 3)), zorder=1)
    ax.plot([at], [1.0], marker=7, color=colour, ms=7, transform=above, clip_on=False, zorder=7)
    if name:
        text, place = f"{name}{sweep.shown_series_deg:g}°", ((at, 1.0), (0, 8), above)
        ax.annotate(text, *place, "offset points", ha="center", color=colour, size=9)


def _set_angles(ax: Axes, sweeps: Sequence[PlottedSweep], *, narrow: bool) -> bool:
    """Set limits and ticks of the swept axis; return True if it has negative angles."""
    axis = sweeps[0].axis
    both = axis is VIEW or min(float(s.x_deg[0]) for s in sweeps) < -1.0
    end, step = (182, 90 if narrow else 45) if axis is AZIMUTH else (92, 30)
    ax.set_xlim(-end if both else -2, end)
    ticks = range(-(end // step) * step if both else 0, end, step)
    cut = narrow and both and axis is not AZIMUTH
    ax.set_xticks([tick for tick in ticks if not cut or abs(tick) < 90])
    return both


def _angle_axis(ax: Axes, sweep: PlottedSweep, sweeps: Sequence[PlottedSweep], small: bool) -> None:
    """Set up the swept axis and label its two sides."""
    axis = sweep.axis
    both = _set_angles(ax, sweeps, narrow=small)
    if both and axis.side:
        gap = "\u2003" * (1 if small else 8)
        away = "mirror side" if sweep.in_plane else "far side"
        ax.set_xlabel(f"← {away}{gap}{axis.label}{gap}{axis.side} →")
    else:
        side = f", on the {axis.side}" if sweep.in_plane else ""
        ax.set_xlabel(f"{axis.label}{side}")


def _series(sweeps: Sequence[PlottedSweep]) -> dict[int, PlottedSweep]:
    return {s.series: s for s in sorted(sweeps, key=lambda s: s.series)}


def _legend_shape(sweeps: Sequence[PlottedSweep], narrow: bool) -> tuple[int, int]:
    """Numbers of rows and columns of the legend."""
    entries = len(_series(sweeps))
    rows = -(-entries // (_NARROW_COLUMNS if narrow else _LEGEND_COLUMNS))
    return rows, -(-entries // rows)


def _legend(figure: Figure, sweeps: Sequence[PlottedSweep], narrow: bool) -> None:
    from matplotlib.lines import Line2D

    handles = []
    for series, sweep in _series(sweeps).items():
        colour, marker, dashes = style_of(series)
        label = f"{sweep.axis.series} = {sweep.shown_series_deg:g}°"
        line = dashes if any(s.lines for s in sweeps) else ""
        handles.append(Line2D([], [], c=colour, marker=marker, ls=line, label=label))
    columns = _legend_shape(sweeps, narrow)[1]
    length = 2.8 if narrow else 3.6
    figure.legend(
        handles=handles, loc="upper center", ncols=columns, frameon=False, handlelength=length
    )
