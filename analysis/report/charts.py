"""Charts of the report, as SVG text for an HTML page.

Each incidence has the same colour, marker and line style in every chart, so that the charts can be
read without colour. Texts from the record appear in captions only, never in a chart.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.report.data import PlottedSweep
from analysis.report.style import BAND, GREY, GRID, INK, Dashes, style_of, svg_of
from instrument.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# More panels would be too small to read and slow to draw.
MAX_PANELS = 12

_LOG_RATIO = 40.0  # largest over smallest value above which the scale is logarithmic
_ANGLES_DEG = (-90, -60, -30, 0, 30, 60, 90)
_NARROW_ANGLES_DEG = (-60, -30, 0, 30, 60)
_LEGEND_COLUMNS = 4
_RUNNER_UP: tuple[Dashes, ...] = ((0, (5, 2)), (0, (1.5, 1.5)))


def sweep_label(sweep: PlottedSweep, planes: int) -> str:
    """Label of a sweep: its incidence, and its plane where there are several."""
    plane = f", Δφ = {sweep.plane_deg:g}°" if planes > 1 or not sweep.in_plane else ""
    return f"θᵢ = {round(sweep.theta_i_deg, 1):g}°{plane}"


def normalised_charts(sweeps: Sequence[PlottedSweep]) -> list[str]:
    """L(theta_r) / L(0) against theta_r above the residuals: one column per plane, two a chart."""
    planes = _planes(sweeps)
    pairs = [planes[i : i + 2] for i in range(0, len(planes), 2)]
    return [_normalised_chart(pair, sweeps, f"normalised{n}") for n, pair in enumerate(pairs)]


def brdf_chart(sweeps: Sequence[PlottedSweep], quantity: str) -> str:
    """Measured quantity of each sweep in a panel of its own, with lines of the models."""
    shown = thinned(sweeps)
    columns = min(len(shown), 4 if len(shown) in (4, 7, 8) or len(shown) > 9 else 3)
    rows = -(-len(shown) // columns)
    left = 0.75 if max(float(np.max(np.abs(s.value))) for s in shown) < 1e3 else 1.05

    def draw(figure: Figure) -> None:
        grid = {"hspace": 0.4, "wspace": 0.08, **_margins(figure, left, 0.15, 0.36, 0.58)}
        axes = figure.subplots(
            rows, columns, sharex=True, sharey=True, squeeze=False, gridspec_kw=grid
        )
        for ax, sweep in zip(axes.flat, shown, strict=False):
            _brdf_panel(ax, sweep)
            label = sweep_label(sweep, len(_planes(sweeps)))
            ax.set_title(label, color=INK, loc="left", pad=9)
        for ax in axes.flat[len(shown) :]:
            ax.set_visible(False)
        _value_axis(axes[0, 0], [(s, 1.0) for s in shown])
        axes[0, 0].set_xlim(-92, 92)
        axes[0, 0].set_xticks(_NARROW_ANGLES_DEG)
        for ax in axes.flat[max(len(shown) - columns, 0) : len(shown)]:
            ax.set_xlabel("view angle θᵣ (°)")
            ax.tick_params(labelbottom=True)
        for ax in axes[:, 0]:
            ax.set_ylabel(quantity)

    return svg_of(0.9 + 2.2 * rows, draw, "brdf")


def polar_chart(sweeps: Sequence[PlottedSweep], quantity: str) -> str:
    """Polar chart of the measured quantity in the direction of the camera."""
    planes = _planes(sweeps)
    columns = min(len(planes), 2)
    rows = -(-len(planes) // columns)
    least = min((s.theta_i_deg for s in sweeps if s.in_plane), default=90.0)
    top = max(1.2, 0.1 + 1.38 * float(np.cos(np.radians(least))))

    def draw(figure: Figure) -> None:
        grid = {"wspace": 0.02, "hspace": 0.1, **_margins(figure, 0.05, 0.05, 0.05, 0.05)}
        axes = figure.subplots(rows, columns, squeeze=False, gridspec_kw=grid)
        for ax in axes.flat:
            ax.set_axis_off()
        for ax, plane in zip(axes.flat, planes, strict=False):
            edge = _polar_panel(ax, plane, "" if columns > 1 else quantity)
            ax.set_ylim(-0.24 * edge, top * edge)
            ax.set_aspect("equal")

    unit_in = 2.8 if columns == 1 else 1.5
    return svg_of((0.24 + top) * unit_in * rows + 0.1, draw, "polar")


def thinned(sweeps: Sequence[PlottedSweep]) -> list[PlottedSweep]:
    """At most `MAX_PANELS` of the sweeps, evenly selected."""
    if len(sweeps) <= MAX_PANELS:
        return list(sweeps)
    chosen = np.linspace(0, len(sweeps) - 1, MAX_PANELS).round().astype(int)
    return [sweeps[i] for i in chosen]


def _planes(sweeps: Sequence[PlottedSweep]) -> list[list[PlottedSweep]]:
    """The sweeps grouped by plane of the camera."""
    planes: dict[int, list[PlottedSweep]] = {}
    for sweep in sweeps:
        planes.setdefault(sweep.plane, []).append(sweep)
    return list(planes.values())


def _normalised_chart(
    planes: Sequence[Sequence[PlottedSweep]], sweeps: Sequence[PlottedSweep], name: str
) -> str:
    rows = 2 if any(np.any(np.isfinite(s.residual)) for s in sweeps) else 1
    columns = min(len(_planes(sweeps)), 2)
    titled = columns > 1 or not planes[0][0].in_plane
    legend_in = 0.24 * _legend_shape(sweeps)[0]

    def draw(figure: Figure) -> None:
        margins = _margins(figure, 0.8, 0.15, legend_in + (0.68 if titled else 0.44), 0.58)
        grid: dict[str, Any] = {
            "height_ratios": (3.2, 1.0)[:rows],
            "hspace": 0.1,
            "wspace": 0.06,
            **margins,
        }
        axes = figure.subplots(
            rows, columns, sharex=True, sharey="row", squeeze=False, gridspec_kw=grid
        )
        for column, plane in enumerate(planes):
            _normalised_panel(axes[0, column], plane, columns)
            if titled:
                _plane_title(axes[0, column], plane[0])
            if rows == 2:
                _residual_panel(axes[1, column], plane, _largest_residual(sweeps))
            _view_axis(axes[-1, column], plane[0].in_plane, columns)
        for ax in axes[:, len(planes) :].flat:
            ax.set_visible(False)
        _value_axis(axes[0, 0], [(s, s.at_normal) for s in sweeps])
        axes[0, 0].set_ylabel("L(θᵣ) / L(0)")
        axes[-1, 0].set_ylabel("residual / u" if rows == 2 else "L(θᵣ) / L(0)")
        _legend(figure, sweeps)

    height = (4.9 if rows == 2 else 3.8) + legend_in + (0.24 if titled else 0.0)
    return svg_of(height, draw, name)


def _normalised_panel(ax: Axes, plane: Sequence[PlottedSweep], columns: int) -> None:
    for sweep in plane:
        if not np.isfinite(sweep.at_normal):
            continue
        if sweep.lines:
            _line(ax, sweep.line_deg, sweep.lines[0] / sweep.at_normal, sweep.incidence)
        _points(ax, sweep, sweep.value / sweep.at_normal, sweep.u / sweep.at_normal)
        if sweep.in_plane:
            name = "" if len(plane) > 8 else "lamp " if columns == 1 else " "
            _lamp_mark(ax, sweep, name)


def _plane_title(ax: Axes, sweep: PlottedSweep) -> None:
    other = (sweep.plane_deg + 180.0) % 360.0
    title = f"Δφ = {sweep.plane_deg:g}° (negative θᵣ: Δφ = {other:g}°)"
    ax.set_title(title, color=INK, loc="left", pad=19)


def _residual_panel(ax: Axes, plane: Sequence[PlottedSweep], largest: float) -> None:
    ax.axhspan(-2.0, 2.0, color=BAND, zorder=0)
    ax.axhline(0.0, color=GREY, linewidth=0.8, zorder=1)
    for sweep in plane:
        colour, marker, _ = style_of(sweep.incidence)
        _line(ax, sweep.theta_r_deg, sweep.residual, sweep.incidence, linewidth=0.6)
        ax.plot(sweep.theta_r_deg, sweep.residual, ls="", ms=3.4, c=colour, marker=marker)
    ax.set_ylim(-largest, largest)
    if largest < 8:
        ax.set_yticks([-2, 0, 2])


def _largest_residual(sweeps: Sequence[PlottedSweep]) -> float:
    sizes = np.abs(np.concatenate([s.residual for s in sweeps]))
    return max(3.5, 1.15 * float(np.max(sizes[np.isfinite(sizes)], initial=0.0)))


def _brdf_panel(ax: Axes, sweep: PlottedSweep) -> None:
    _points(ax, sweep, sweep.value, sweep.u, size=3.8)
    for line, style in zip(sweep.lines[1:], _RUNNER_UP, strict=False):
        ax.plot(sweep.line_deg, line, color=GREY, linewidth=1.1, zorder=7, linestyle=style)
    if sweep.lines:
        ax.plot(sweep.line_deg, sweep.lines[0], color=INK, linewidth=1.3, zorder=8)
    if sweep.in_plane:
        _lamp_mark(ax, sweep, "")


def _polar_panel(ax: Axes, plane: Sequence[PlottedSweep], quantity: str) -> float:
    """Draw a plane and return the radius of its edge; a small panel has no `quantity`."""
    unflagged = [s.value[~s.flagged] for s in plane]
    rings = _rings(max(float(np.max(v, initial=0.0)) for v in unflagged))
    edge = rings[-1]
    _polar_frame(ax, rings, quantity)
    for sweep in plane:
        colour, marker, dashes = style_of(sweep.incidence)
        if sweep.lines:
            ax.plot(*_polar(sweep.line_deg, sweep.lines[0]), color=colour, linestyle=dashes)
        good = ~sweep.flagged & (sweep.value >= 0)
        x, y = _polar(sweep.theta_r_deg[good], sweep.value[good])
        ax.plot(x, y, ls="", marker=marker, color=colour, ms=4.0)
        if sweep.in_plane:
            _lamp_arrow(ax, sweep, edge, 1.13 if quantity else 1.19)
    ax.set_xlim(-1.55 * edge, 1.55 * edge)
    if not quantity:
        title = f"Δφ = {plane[0].plane_deg:g}°"
        ax.text(-1.5 * edge, 1.1 * edge, title, size=10.5, color=INK, va="top")
    return float(edge)


def _lamp_arrow(ax: Axes, sweep: PlottedSweep, edge: float, tip: float) -> None:
    """Draw an arrow from the lamp, with the marker of the incidence at its tail."""
    colour, marker, _ = style_of(sweep.incidence)
    x, y = _polar(np.full(3, sweep.theta_i_deg), np.array([1.34, tip, 1.39]) * edge)
    arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.4, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", (x[1], y[1]), (x[0], y[0]), arrowprops=arrow)
    ax.plot(x[0], y[0], marker=marker, color=colour, ms=5)
    text = f"lamp {round(sweep.theta_i_deg, 1):g}°"
    side = "left" if sweep.theta_i_deg > 8 else "center"
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


def _points(
    ax: Axes, sweep: PlottedSweep, value: FloatArray, u: FloatArray, size: float = 4.5
) -> None:
    """Plot filled markers for points in the fit, open ones for others, crosses on flagged ones."""
    colour, marker, _ = style_of(sweep.incidence)
    x, flagged = sweep.theta_r_deg, sweep.flagged
    hollow = flagged | (~sweep.fitted & bool(np.any(sweep.fitted)))
    ax.vlines(x, value - u, value + u, color=colour, linewidth=1.0, zorder=4)
    plain: dict[str, Any] = {"ls": "", "marker": marker, "color": colour, "ms": size, "zorder": 5}
    ax.plot(x[~hollow], value[~hollow], **plain)
    if np.any(hollow):
        ax.plot(x[hollow], value[hollow], mfc="white", **plain)
    if np.any(flagged):
        ax.plot(x[flagged], value[flagged], ls="", marker="x", ms=8, c=INK, mew=1.2, zorder=6)


def _line(ax: Axes, x: FloatArray, y: FloatArray, incidence: int, linewidth: float = 1.5) -> None:
    colour, _, dashes = style_of(incidence)
    ax.plot(x, y, color=colour, linestyle=dashes, linewidth=linewidth, zorder=2)


def _lamp_mark(ax: Axes, sweep: PlottedSweep, name: str) -> None:
    """Mark theta_r = theta_i above the panel; with a `name`, also write the angle."""
    colour = style_of(sweep.incidence)[0]
    at, above = sweep.theta_i_deg, ax.get_xaxis_transform()
    ax.axvline(at, color=colour, linewidth=0.7, linestyle=(0, (1, 3)), zorder=1)
    ax.plot([at], [1.0], marker=7, color=colour, ms=7, transform=above, clip_on=False, zorder=7)
    if name:
        text, place = f"{name}{round(at, 1):g}°", ((at, 1.0), (0, 8), above, "offset points")
        ax.annotate(text, *place, ha="center", color=colour, size=9)


def _view_axis(ax: Axes, in_plane: bool, columns: int) -> None:
    """Set up the axis of the view angle and label its two sides."""
    ax.set_xlim(-92, 92)
    ax.set_xticks(_ANGLES_DEG if columns == 1 else _NARROW_ANGLES_DEG)
    gap = "\u2003" * (8 if columns == 1 else 2)
    away = "mirror side" if in_plane else "far side"
    ax.set_xlabel(f"← {away}{gap}view angle θᵣ (°){gap}lamp’s side →")


def _value_axis(ax: Axes, scaled: Sequence[tuple[PlottedSweep, float]]) -> None:
    """Scale from zero to a little above the largest value, or logarithmic for a large range.

    A flagged outlier does not compress the others: it may lie outside the axes.
    """
    good = [s.value[~s.flagged] / unit for s, unit in scaled]
    lines = [s.lines[0] / unit for s, unit in scaled if s.lines]
    low, high = _extent([*good, *lines])
    flagged = [s.value[s.flagged] / unit for s, unit in scaled]
    flagged_low, flagged_high = _extent([*good, *lines, *flagged])
    if not np.isfinite(flagged_low):
        return
    if low > 0 and high > _LOG_RATIO * low:
        _log_axis(ax, low / 1.5, high * 1.5)
        return
    if np.isfinite(low):
        low, high = max(flagged_low, -0.5 * abs(high)), min(flagged_high, 2.0 * abs(high))
    else:
        low, high = flagged_low, flagged_high
    if high > 0:
        ax.set_ylim(min(0.0, 1.1 * low), 1.12 * high)


def _log_axis(ax: Axes, low: float, high: float) -> None:
    from matplotlib.ticker import LogLocator, NullLocator

    ax.set_yscale("log")
    ax.set_ylim(low, high)
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 1000 * low else (1.0,)))
    ax.yaxis.set_minor_locator(NullLocator())
    ax.yaxis.set_major_formatter("{x:g}")


def _extent(arrays: Sequence[FloatArray]) -> tuple[float, float]:
    """Smallest and largest finite value, NaN if there is none."""
    values = np.concatenate(arrays) if arrays else np.array([])
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if len(values) else (np.nan, np.nan)


def _incidences(sweeps: Sequence[PlottedSweep]) -> dict[int, float]:
    return {s.incidence: s.theta_i_deg for s in sorted(sweeps, key=lambda s: s.incidence)}


def _legend_shape(sweeps: Sequence[PlottedSweep]) -> tuple[int, int]:
    """Numbers of rows and columns of the legend."""
    entries = len(_incidences(sweeps))
    rows = -(-entries // _LEGEND_COLUMNS)
    return rows, -(-entries // rows)


def _legend(figure: Figure, sweeps: Sequence[PlottedSweep]) -> None:
    from matplotlib.lines import Line2D

    handles = []
    for incidence, theta_i_deg in _incidences(sweeps).items():
        colour, marker, dashes = style_of(incidence)
        label = f"lamp at θᵢ = {round(theta_i_deg, 1):g}°"
        line = dashes if any(s.lines for s in sweeps) else ""
        handles.append(Line2D([], [], c=colour, marker=marker, ls=line, label=label))
    columns = _legend_shape(sweeps)[1]
    figure.legend(
        handles=handles, loc="upper center", ncols=columns, frameon=False, handlelength=3.6
    )


def _margins(
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
