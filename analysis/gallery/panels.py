"""Charts of the gallery: lines over an angle, and polar diagrams, at half the width of a page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analysis.gallery.figure import Panel
from analysis.report.figures.charts import margins
from analysis.report.style import GREY, GRID, INK, style_of
from instrument.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_HEIGHT_IN, _LEGEND_ROW_IN = 2.75, 0.2
_LABELS = 60  # characters of a row of the legend, with its lines
_TICKS: dict[tuple[float | None, float | None], tuple[int, ...]] = {
    (-90.0, 90.0): (-90, -60, -30, 0, 30, 60, 90),
    (0.0, 90.0): (0, 15, 30, 45, 60, 75, 90),
}
VIEW = "view angle θᵣ (°), + on the lamp’s side"
MIRROR_SIDE = "view angle θᵣ (°), + on the mirror side"


class Line(NamedTuple):
    """Curve: places and values (N,), label, number of its style; `thin`, as the papers draw it."""

    x: FloatArray
    y: FloatArray
    label: str = ""
    style: int = 0
    thin: bool = False


class Axis(NamedTuple):
    """Axis: label, range (None: from the values), and places of its ticks."""

    label: str
    range: tuple[float | None, float | None] | None = None
    ticks: tuple[float, ...] = ()


def chart(
    title: str,
    lines: Sequence[Line],
    x: Axis,
    y: Axis,
    at: Sequence[tuple[float, str]] = (),
) -> Panel:
    """Panel of lines; `at`: places on x that are marked by a vertical line and a word."""
    rows = _legend_rows(lines)

    def draw(canvas: Figure) -> None:
        top = 0.12 + _LEGEND_ROW_IN * rows + 0.14 * bool(at)
        axes = canvas.add_subplot(
            canvas.add_gridspec(1, 1, **margins(canvas, 0.72, 0.12, top, 0.5))[0]
        )
        for line in lines:
            colour, _, dashes = style_of(line.style)
            axes.plot(
                line.x, line.y, color=colour, linestyle=dashes, label=line.label or "_",
                linewidth=0.9 if line.thin else 1.6,
            )  # fmt: skip
        _set_axis(axes, x, "x")
        _set_axis(axes, y, "y")
        for place, word in at:
            axes.axvline(place, color=GREY, linewidth=0.8, zorder=0)
            axes.text(
                place, 1.01, word, transform=axes.get_xaxis_transform(), ha="center", size=8.5,
                color=GREY,
            )  # fmt: skip
        _legend(canvas, lines, rows)

    return Panel(title, _HEIGHT_IN + _LEGEND_ROW_IN * rows, draw)


def _set_axis(axes: Axes, axis: Axis, name: str) -> None:
    getattr(axes, f"set_{name}label")(axis.label)
    if axis.range is not None:
        getattr(axes, f"set_{name}lim")(*axis.range)
    ticks = axis.ticks or _TICKS.get(axis.range or (None, None))
    if ticks:
        getattr(axes, f"set_{name}ticks")(ticks)


def _columns(lines: Sequence[Line]) -> int:
    longest = max((len(line.label) for line in lines), default=1)
    return max(1, min(5, _LABELS // (longest + 6)))


def _legend_rows(lines: Sequence[Line]) -> int:
    named = sum(bool(line.label) for line in lines)
    return -(-named // _columns(lines))


def _legend(canvas: Figure, lines: Sequence[Line], rows: int) -> None:
    if rows:
        canvas.legend(
            loc="upper left", ncols=_columns(lines), frameon=False, fontsize=9, handlelength=1.9,
            handletextpad=0.5, columnspacing=1.0, labelspacing=0.25, borderaxespad=0.15,
            bbox_to_anchor=(0.02, 1.0),
        )  # fmt: skip


def sketch(
    title: str, height_in: float, draw_into: Callable[[Axes], None], *, picture: bool = False
) -> Panel:
    """Panel without axes for a drawing to scale."""

    def draw(canvas: Figure) -> None:
        axes = canvas.add_subplot(
            canvas.add_gridspec(1, 1, **margins(canvas, 0.1, 0.1, 0.05, 0.05))[0]
        )
        axes.set_axis_off()
        axes.set_aspect("equal")
        draw_into(axes)

    return Panel(title, height_in, draw, picture)


def polar(
    title: str, lines: Sequence[Line], marks: Sequence[tuple[float, str]] = (), height: float = 1.15
) -> Panel:
    """Polar panel of the upper half plane: x of a line are angles from the normal in degrees.

    Radii are in units of 1. `marks`: directions with an arrow towards the origin, and their name.
    """
    rows = _legend_rows(lines)
    legend_in = 0.1 + _LEGEND_ROW_IN * rows

    def draw(canvas: Figure) -> None:
        axes = canvas.add_subplot(
            canvas.add_gridspec(1, 1, **margins(canvas, 0.05, 0.05, legend_in, 0.05))[0]
        )
        axes.set_axis_off()
        _half_circle(axes)
        for line in lines:
            colour, _, dashes = style_of(line.style)
            angle = np.radians(line.x)
            axes.plot(
                line.y * np.sin(angle), line.y * np.cos(angle), color=colour, linestyle=dashes,
                label=line.label or "_",
            )  # fmt: skip
        for angle_deg, word in marks:
            _arrow(axes, angle_deg, word)
        axes.set_xlim(-1.3, 1.3)
        axes.set_ylim(-0.08, height)
        axes.set_aspect("equal")
        _legend(canvas, lines, rows)

    return Panel(title, 4.2 * (height + 0.08) / 2.6 + legend_in, draw)


def _half_circle(axes: Axes) -> None:
    around = np.radians(np.linspace(-90, 90, 91))
    for ring in (0.25, 0.5, 0.75, 1.0):
        axes.plot(ring * np.sin(around), ring * np.cos(around), color=GRID, linewidth=0.7, zorder=0)
    for angle in np.radians([-60.0, -30.0, 0.0, 30.0, 60.0]):
        axes.plot([0, np.sin(angle)], [0, np.cos(angle)], color=GRID, linewidth=0.7, zorder=0)
    axes.plot([-1.1, 1.1], [0, 0], color=INK, linewidth=1.8, zorder=1)


def _arrow(axes: Axes, angle_deg: float, word: str) -> None:
    angle = np.radians(angle_deg)
    x, y = np.array([1.28, 1.02]) * np.sin(angle), np.array([1.28, 1.02]) * np.cos(angle)
    arrow = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (x[1], y[1]), (x[0], y[0]), arrowprops=arrow)
    side = "left" if angle_deg < 0 else "right"
    axes.text(x[0], y[0] + 0.03, word, ha=side, va="bottom", size=9, color=INK)
