"""Pictures of the gallery: rendered objects side by side, contours, reflectance maps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from analysis.gallery.figure import Panel
from analysis.report.figures.charts import margins
from analysis.report.style import INK, NARROW_IN
from instrument.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIZE = 200
"""Width and height of a picture in pixels."""

_LEVELS = 9


def pictures(
    title: str, images: Sequence[FloatArray], words: Sequence[str] = (), brightest: float = 0.0
) -> Panel:
    """Panel of pictures (R, C) in a row, of one unit; `brightest` is white, by default the maximum.

    NaN, beside an object, is black. `words`: one below each.
    """
    white = brightest or max(float(np.nanmax(image)) for image in images)

    def draw_into(axes: Axes, number: int) -> None:
        axes.imshow(
            np.nan_to_num(images[number]), cmap="gray", vmin=0.0, vmax=white, interpolation="none"
        )
        if words:
            axes.text(
                0.5, -0.03, words[number], transform=axes.transAxes, ha="center", va="top",
                size=9.5, color=INK,
            )  # fmt: skip

    return _row(title, [image.shape for image in images], draw_into, bool(words))


def contours(
    title: str,
    values: FloatArray,
    levels: Sequence[float],
    x: FloatArray,
    y: FloatArray,
    labels: tuple[str, str] = ("", ""),
    *,
    outline: bool = False,
    labelled: bool = False,
) -> Panel:
    """Panel of lines of equal brightness of values (Y, X) over x and y, in their units.

    `labels` of both axes: none for a picture. `outline`: the unit circle is drawn around.
    `labelled`: each line has its value in percent.
    """

    def draw(canvas: Figure) -> None:
        bottom, left = (0.55, 0.75) if labels[0] else (0.1, 0.1)
        axes = canvas.add_subplot(
            canvas.add_gridspec(1, 1, **margins(canvas, left, 0.15, 0.1, bottom))[0]
        )
        drawn = axes.contour(x, y, values, levels=levels, colors=INK, linewidths=1.0)
        if labelled:
            axes.clabel(drawn, fmt=lambda level: f"{100 * level:g} %", fontsize=8.5)
        axes.set_aspect("equal")
        if labels[0]:
            axes.set_xlabel(labels[0])
            axes.set_ylabel(labels[1])
        else:
            axes.set_axis_off()
        if outline:
            turn = np.linspace(0, 2 * np.pi, 361)
            axes.plot(np.cos(turn), np.sin(turn), color=INK, linewidth=1.6)

    return Panel(title, 3.9 if labels[0] else NARROW_IN, draw)


def even_levels(values: FloatArray, count: int = _LEVELS, least: float = 0.0) -> list[float]:
    """Brightnesses between `least` and the largest of values (...), in their unit, evenly."""
    steps = np.linspace(least, float(np.nanmax(values)), count + 2)
    return [float(step) for step in steps[1:-1]]


def _row(
    title: str,
    shapes: Sequence[tuple[int, ...]],
    draw_into: Callable[[Axes, int], None],
    words: bool,
) -> Panel:
    widths = [shape[1] / shape[0] for shape in shapes]
    below = 0.26 if words else 0.03
    height = (NARROW_IN - 0.06 - 0.06 * (len(shapes) - 1)) / sum(widths) + below

    def draw(canvas: Figure) -> None:
        grid = canvas.add_gridspec(
            1, len(shapes), width_ratios=widths, wspace=0.02,
            **margins(canvas, 0.03, 0.03, 0.0, below),
        )  # fmt: skip
        for number in range(len(shapes)):
            axes = canvas.add_subplot(grid[0, number])
            axes.set_axis_off()
            draw_into(axes, number)

    return Panel(title, height, draw, picture=True)
