"""Charts of cost (right) against error (up), as SVG text; better is below and to the left.

All charts have one style: a marker and a colour per series, a thin line from the worst error down
to the median, the Pareto front as a stepped line, a ring around the program's own choice.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from acquisition.benchmark.number_text import short
from acquisition.benchmark.output.axes_grid import axes_grid
from acquisition.benchmark.output.labels import Box, Placed, place
from acquisition.benchmark.study import Study
from acquisition.benchmark.trial import Trial, pareto_front
from analysis.report.style import GREY, INK, style_of, svg_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

_SIZE = 7.5  # points, of labels
_FRONT: dict[str, Any] = {"color": "#999999", "linewidth": 1.2, "zorder": 1}
_PEER = "P"  # marker of other programs, in every chart

MAIN = (("rough_surface", 1), ("window", 1), ("fit_misses", 2), ("scan", 0))
"""Studies of the main chart, and which of their scenes it shows."""


def study_chart(study: Study) -> str:
    """Return the scenes of a study side by side, with one error axis."""
    scenes = study.scenes
    legend = _series_legend(study)
    rows = -(-len(legend) // 4)

    def draw(figure: Figure) -> None:
        top_in = 0.32 + 0.21 * rows
        axes = axes_grid(
            figure, 1, len(scenes), top_in=top_in, bottom_in=0.5, wspace=0.06, share_y=True
        )
        limits = _limits(study.trials)
        for ax, scene in zip(axes, scenes, strict=True):
            _panel(ax, study, scene, limits, ax is axes[0])
            ax.set_title(scene, color=INK, loc="left", pad=5)
            ax.set_xlabel(study.cost_axis)
        axes[0].set_ylabel(study.error_axis)
        figure.legend(
            handles=legend, loc="upper center", ncols=4, frameon=False, fontsize=8.5,
            borderaxespad=0.1, handlelength=1.8, labelspacing=0.25,
        )  # fmt: skip

    return svg_of(4.1 + 0.21 * rows, draw, study.name)


def main_chart(studies: Sequence[Study]) -> str:
    """Return the chart of the README: four panels, one for each kind of choice."""
    known = {study.name: study for study in studies}
    shown = [(known[name], min(n, len(known[name].scenes) - 1)) for name, n in MAIN]

    def draw(figure: Figure) -> None:
        axes = axes_grid(figure, 2, 2, top_in=0.714, bottom_in=0.521, wspace=0.2, hspace=0.33)
        for ax, (study, n) in zip(axes, shown, strict=True):
            scene = study.scenes[n]
            _panel(ax, study, scene, _limits(study.in_scene(scene)))
            ax.set_title(f"{study.title.partition(':')[0]}: {scene}", color=INK, loc="left", pad=5)
            ax.set_xlabel(study.cost_axis)
            ax.set_ylabel(study.error_axis)
        figure.legend(
            handles=_signs(peer=True), loc="upper center", ncols=5, frameon=False, fontsize=9
        )

    return svg_of(8.4, draw, "main")


def standalone(svg: str) -> str:
    """Return an SVG of a page as a file of its own: white background, fallback fonts."""
    head, end, body = svg.partition(">")
    fonts = '"DejaVu Sans", Verdana, Arial, sans-serif'.replace('"', "&quot;")
    white = '<rect width="100%" height="100%" fill="white"/>'
    return head + end + white + body.replace("'DejaVu Sans'", fonts)


def _panel(
    ax: Axes, study: Study, scene: str, limits: tuple[float, float], first: bool = True
) -> None:
    """Draw one scene; the `first` panel of a row has the numbers of the error axis."""
    trials = study.in_scene(scene)
    shown = [_clipped(t, limits) for t in trials]
    front = [_clipped(t, limits) for t in pareto_front(trials)]
    _scale(ax, study, limits)
    _draw_front(ax, front)
    for number, series in enumerate(study.series):
        own = [t for t in shown if t.series == series]
        if study.joined:
            colour, _, dashes = style_of(number)
            x, y = [t.cost for t in own], [t.error for t in own]
            ax.plot(x, y, color=colour, linestyle=dashes, linewidth=1.0, zorder=2)
        for trial in own:
            _mark(ax, trial, number)
    _write_labels(ax, study, shown, front)
    if first and any(t.error == 0 for t in trials):
        ax.text(-0.015, 0, "0", transform=ax.transAxes, ha="right", va="center", size=9, color=INK)


def _limits(trials: Sequence[Trial]) -> tuple[float, float]:
    """Ends of the error axis; errors of 0 lie on its lower end, infinite ones on the upper."""
    pairs = [(t.error, min(t.error, t.error_median)) for t in trials]
    errors = [e for pair in pairs for e in pair if 0 < e < math.inf]
    low, high = min(errors, default=0.1), max(errors, default=1.0)
    room = max((high / low) ** 0.08, 2.0)
    for_zero = room**3 if any(t.error == 0 for t in trials) else 1.0
    return low / room / for_zero, high * room


def _clipped(trial: Trial, limits: tuple[float, float]) -> Trial:
    """Move errors outside the axis to its ends, and the median to the error at most."""
    low, high = limits
    error = min(max(trial.error, low), high)
    return replace(trial, error=error, error_median=min(max(trial.error_median, low), error))


def _scale(ax: Axes, study: Study, limits: tuple[float, float]) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    costs = [t.cost for t in study.trials]
    few = math.log10(max(costs) / min(costs)) < 1.5
    room = 1.4 if few else 3.0
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlim(min(costs) / room, max(costs) * room)
    ax.set_ylim(*limits)
    ax.tick_params(labelsize=9)
    close = limits[1] < 100 * limits[0]
    for axis, fine, ticks in ((ax.xaxis, few, 12), (ax.yaxis, close, 9)):
        subs = (1.0, 2.0, 5.0) if fine else (1.0,)
        axis.set_major_locator(LogLocator(subs=subs, numticks=ticks))
        axis.set_major_formatter(FuncFormatter(lambda value, _: short(value)))
        axis.set_minor_locator(NullLocator())


def _draw_front(ax: Axes, front: Sequence[Trial]) -> None:
    if front:
        x = [front[0].cost, *(t.cost for t in front), ax.get_xlim()[1]]
        y = [ax.get_ylim()[1], *(t.error for t in front), front[-1].error]
        ax.plot(x, y, drawstyle="steps-post", **_FRONT)


def _mark(ax: Axes, trial: Trial, number: int) -> None:
    colour, marker, _ = style_of(number)
    x, y, low = trial.cost, trial.error, trial.error_median
    if trial.bound:
        ax.plot(x, y, ls="", marker="_", ms=8, mew=1.4, c=colour, zorder=3)
        return
    ax.plot([x, x], [low, y], color=colour, linewidth=0.8, zorder=2)
    ax.plot(x, low, ls="", marker="_", ms=4, c=colour, zorder=2)
    style: dict[str, Any] = {"ls": "", "mew": 1.3, "clip_on": False}
    fill, marker = ("white", _PEER) if trial.peer else (colour, marker)
    ax.plot(x, y, marker=marker, ms=6, c=colour, mfc=fill, zorder=4, **style)
    if trial.default:
        ax.plot(x, y, marker="o", ms=13, c=INK, mfc="none", zorder=5, **style)


def _write_labels(ax: Axes, study: Study, trials: Sequence[Trial], front: Sequence[Trial]) -> None:
    """Write labels beside the marks, with a thin line to those that have no room next to theirs."""
    marks = [_points(ax, t.cost, t.error) for t in trials]
    texts = [_label(t, study, trials) for t in trials]
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    left, bottom = _points(ax, left, bottom)
    right, top = _points(ax, right, top)
    frame = Box(left + 1, bottom + 1, right - 1, top - 1)
    found = place(marks, texts, frame, _SIZE, _obstacles(ax, trials, front))
    for mark, text, trial, placed in zip(marks, texts, trials, found, strict=True):
        if text:
            _write(ax, mark, placed, text, "bold" if trial.default else "normal")


def _points(ax: Axes, x: float, y: float) -> tuple[float, float]:
    """Convert data coordinates to points of the figure."""
    to_points = ax.transData - ax.figure.dpi_scale_trans
    at = 72 * to_points.transform((x, y))
    return float(at[0]), float(at[1])


def _obstacles(ax: Axes, trials: Sequence[Trial], front: Sequence[Trial]) -> list[Box]:
    """Boxes that labels avoid: rings, the lines to the medians, the front."""
    boxes = []
    for t in trials:
        x, y = _points(ax, t.cost, t.error)
        if t.default:
            boxes.append(Box(x - 8, y - 8, x + 8, y + 8))
        boxes.append(Box(x - 1, _points(ax, t.cost, t.error_median)[1], x + 1, y))
    if not front:
        return boxes
    corners = [_points(ax, t.cost, t.error) for t in front]
    right, top = _points(ax, ax.get_xlim()[1], ax.get_ylim()[1])
    (x, y), end = corners[0], (right, corners[-1][1])
    boxes.append(Box(x - 1, y, x + 1, top))
    for (x, y), (to_x, to_y) in zip(corners, [*corners[1:], end], strict=True):
        boxes += [Box(x, y - 1, to_x, y + 1), Box(to_x - 1, to_y, to_x + 1, y)]
    return boxes


def _write(ax: Axes, mark: tuple[float, float], placed: Placed, text: str, weight: str) -> None:
    box = placed.box
    line = {"arrowstyle": "-", "color": GREY, "linewidth": 0.5, "shrinkA": 0, "shrinkB": 4}
    ax.annotate(
        text, xy=mark, xycoords="figure points",
        xytext=((box.left + box.right) / 2, (box.bottom + box.top) / 2),
        textcoords="figure points", ha="center", va="center_baseline", size=_SIZE, color=INK,
        weight=weight, zorder=6, arrowprops=line if placed.far else None, annotation_clip=False,
        bbox={"fc": "white", "ec": "none", "pad": 0.4, "alpha": 0.75},
    )  # fmt: skip


def _label(trial: Trial, study: Study, trials: Sequence[Trial]) -> str:
    """Text of a mark: the method's name; for limits their kind, once, beside the default."""
    if trial.bound:
        beside = any(t.default and t.cost == trial.cost for t in trials)
        return trial.series if beside else ""
    if trial.default:
        return f"{trial.label} (default)"
    return "" if study.joined else trial.label


def _series_legend(study: Study) -> list[Line2D]:
    handles = []
    for number, series in enumerate(study.series):
        colour, marker, dashes = style_of(number)
        own = [t for t in study.trials if t.series == series]
        peer = all(t.peer for t in own)
        shape = "_" if all(t.bound for t in own) else _PEER if peer else marker
        line, fill = dashes if study.joined else "", "white" if peer else colour
        handles.append(_sign(series, ls=line, marker=shape, ms=6, c=colour, mfc=fill, mew=1.3))
    return handles + _signs(error_is=study.error_is)


def _signs(error_is: str = "worst", peer: bool = False) -> list[Line2D]:
    """Legend entries of the front, the ring and the thin line."""
    found = [
        _sign("Pareto front", ls="-", c=_FRONT["color"], lw=_FRONT["linewidth"]),
        _sign("program’s default", marker="o", ms=10, mfc="none", mew=1.3),
        _sign(f"{error_is} (mark) to median", marker="|", ms=11, c=GREY),
    ]
    if peer:
        found.append(_sign("another program", marker=_PEER, ms=7, mfc="white"))
        found.append(_sign("limit (Cramér–Rao)", marker="_", ms=8, mew=1.4))
    return found


def _sign(label: str, **style: Any) -> Line2D:
    from matplotlib.lines import Line2D

    return Line2D([], [], **{"ls": "", "c": INK, "label": label, **style})
