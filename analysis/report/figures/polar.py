"""Polar chart of a report: the measured quantity in the direction of the camera."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from analysis.report.figures.charts import margins, panels_of, thinned_series
from analysis.report.style import GREY, GRID, INK, NARROW_IN, WIDTH_IN, Drawing, Marks, style_of
from analysis.report.sweeps import PlottedSweep
from instrument.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ANGLES_DEG = (-90, -60, -30, 0, 30, 60, 90)


def polar_drawing(
    sweeps: Sequence[PlottedSweep], quantity: str, *, narrow: bool = False
) -> Drawing:
    """Polar chart of the measured quantity in the direction of the camera."""
    sweeps = thinned_series(sweeps)
    planes = panels_of(sweeps)
    columns = 1 if narrow else min(len(planes), 2)
    small = narrow or columns > 1
    rows = -(-len(planes) // columns)
    least = min((s.series_deg for s in sweeps if s.in_plane), default=90.0)
    top = max(1.2, 0.1 + 1.38 * float(np.cos(np.radians(least))))

    def draw(figure: Figure) -> list[Marks]:
        grid = {"wspace": 0.02, "hspace": 0.1, **margins(figure, 0.05, 0.05, 0.05, 0.05)}
        axes = figure.subplots(rows, columns, squeeze=False, gridspec_kw=grid)
        for ax in axes.flat:
            ax.set_axis_off()
        marks: list[Marks] = []
        for ax, plane in zip(axes.flat, planes, strict=False):
            edge, drawn = _polar_panel(ax, plane, "" if small else quantity)
            marks += drawn
            ax.set_ylim(-0.24 * edge, top * edge)
            ax.set_aspect("equal")
        return marks

    unit_in = 1.36 if narrow else 1.5 if small else 2.8
    height = (0.24 + top) * unit_in * rows + 0.1
    return Drawing(height, draw, NARROW_IN if narrow else WIDTH_IN)


def _polar_panel(
    ax: Axes, plane: Sequence[PlottedSweep], quantity: str
) -> tuple[float, list[Marks]]:
    """Draw a plane; return the radius of its edge and the marks. A small one has no `quantity`."""
    unflagged = [s.value[~s.flagged] for s in plane]
    rings = _rings(max(float(np.max(v, initial=0.0)) for v in unflagged))
    edge = rings[-1]
    _polar_frame(ax, rings, quantity)
    marks = []
    for sweep in plane:
        colour, marker, dashes = style_of(sweep.series)
        if sweep.lines:
            ax.plot(*_polar(sweep.line_deg, sweep.lines[0]), color=colour, linestyle=dashes)
        good = ~sweep.flagged & (sweep.value >= 0)
        x, y = _polar(sweep.x_deg[good], sweep.value[good])
        ax.plot(x, y, ls="", marker=marker, color=colour, ms=4.0)
        marks.append(Marks(ax, x, y, sweep.at[good]))
        if sweep.in_plane:
            _lamp_arrow(ax, sweep, edge, small=not quantity)
    ax.set_xlim(-1.55 * edge, 1.55 * edge)
    if not quantity:
        title = f"Δφ = {plane[0].shown_panel_deg:g}°"
        ax.text(-1.5 * edge, 1.1 * edge, title, size=10.5, color=INK, va="top")
    return float(edge), marks


def _lamp_arrow(ax: Axes, sweep: PlottedSweep, edge: float, *, small: bool) -> None:
    """Draw an arrow from the lamp, with the marker of the incidence at its tail."""
    colour, marker, _ = style_of(sweep.series)
    tip = 1.19 if small else 1.13
    x, y = _polar(np.full(3, sweep.series_deg), np.array([1.34, tip, 1.39]) * edge)
    arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.4, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", (x[1], y[1]), (x[0], y[0]), arrowprops=arrow)
    ax.plot(x[0], y[0], marker=marker, color=colour, ms=5)
    text = f"{'' if small else 'lamp '}{sweep.shown_series_deg:g}°"
    side = "left" if sweep.series_deg > 8 else "center"
    ax.text(x[2], y[2], text, color=colour, ha=side, va="bottom" if side == "center" else "center")


def _polar_frame(ax: Axes, rings: FloatArray, quantity: str) -> None:
    around = np.linspace(-90.0, 90.0, 91)
    edge, below = rings[-1], -0.035 * rings[-1]
    for ring in rings[1:]:
        ax.plot(*_polar(around, np.full(91, ring)), color=GRID, linewidth=0.7, zorder=0)
    for ring in rings[1:] if quantity else rings[-1:]:
        ax.text(-ring, below, f"{ring:g}", ha="center", va="top", size=9, color=GREY)
    outside = 1.07 if quantity else 1.12
    for angle in _ANGLES_DEG:
        x, y = _polar(np.full(3, float(angle)), np.array([0.0, edge, outside * edge]))
        ax.plot(x[:2], y[:2], color=GRID, linewidth=0.7, zorder=0)
        ax.text(x[2], y[2], f"{angle}°".replace("-", "−"), ha="center", va="center", color=GREY)
    ax.plot([-edge, edge], [0, 0], color=INK, linewidth=2.0, zorder=1)
    ax.text(0.0, below, "sample", ha="center", va="top", color=INK)
    ax.text(-0.5 * edge, 3.6 * below, quantity, ha="center", va="top", size=9, color=GREY)
    ax.text(edge, below, "lamp’s side →", ha="right", va="top", color=INK)


def _polar(theta_r_deg: FloatArray, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
    angle = np.radians(theta_r_deg)
    return radius * np.sin(angle), radius * np.cos(angle)


def _rings(largest: float) -> FloatArray:
    from matplotlib.ticker import MaxNLocator

    largest = largest if largest > 0 else 1.0
    found = MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10]).tick_values(0.0, largest)
    ticks = np.asarray(found, dtype=np.float64)
    return ticks[ticks >= 0]
