"""Look of the maps: grey regions with a contour at each level, and the reason in each region.

Greys, lines and words only, so that a map reads the same in black and white.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from acquisition.benchmark.output.axes_grid import axes_grid
from analysis.report.style import INK
from instrument.geometry import BoolArray, FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PERCENT = (0.1, 1.0, 5.0, 20.0)
"""The levels of every map of errors."""

_GREYS = ("#FFFFFF", "#EDEDED", "#D6D6D6", "#B4B4B4", "#8A8A8A")
_WIDTHS = (0.6, 0.9, 1.3, 1.8)
_Dash = Literal["dotted", "dashed", "dashdot", "solid"]
_DASHES: tuple[_Dash, ...] = ("dotted", "dashed", "dashdot", "solid")
_LETTER_IN = (0.066, 0.112)  # width and height of the words' letters, in inches
_LEAST_SIDE = 0.11  # of a panel: a region narrower than this has no room for words


@dataclass(frozen=True, slots=True)
class Reason:
    """Text for the region where values exceed `level`, between two values of x."""

    words: str
    level: float
    from_x: float = -np.inf
    to_x: float = np.inf


@dataclass(frozen=True, slots=True)
class Panel:
    """One set of axes: `values` of shape (y, x) over the axes' coordinates, and the reasons."""

    title: str
    x: FloatArray
    y: FloatArray
    values: FloatArray
    reasons: Sequence[Reason]


def draw_panels(
    figure: Figure,
    rows: int,
    panels: Sequence[Panel],
    *,
    levels: Sequence[float] = PERCENT,
    unit: str = " %",
    wspace: float = 0.08,
    share: bool = True,
) -> list[Axes]:
    """Draw panels row by row, with the legend of their levels above; return their axes."""
    axes = axes_grid(
        figure, rows, len(panels) // rows, top_in=0.62, left=0.07, wspace=wspace,
        share_x=share, share_y=share,
    )  # fmt: skip
    for ax, panel in zip(axes, panels, strict=True):
        _contours(ax, panel, levels)
        _write_reasons(ax, panel)
        ax.set_title(panel.title, color=INK, loc="left", pad=4)
    _level_legend(figure, levels, unit)
    return axes


def label_axes(axes: Sequence[Axes], columns: int, x: str, y: str) -> None:
    """Label x below the last row and y left of the first column."""
    for ax in axes[-columns:]:
        ax.set_xlabel(x, fontsize=9.5)
    for ax in axes[::columns]:
        ax.set_ylabel(y)


def _contours(ax: Axes, panel: Panel, levels: Sequence[float]) -> None:
    """Fill the regions between levels, lighter where values are lower, and draw their edges."""
    x, y, values = panel.x, panel.y, panel.values
    top = 2 * max(float(np.max(values[np.isfinite(values)], initial=0.0)), levels[-1])
    shown = np.clip(np.where(np.isfinite(values), values, top), levels[0] * 1e-3, top)
    edges = [levels[0] * 1e-4, *levels, 2 * top]
    ax.contourf(x, y, shown, levels=edges, colors=_GREYS)
    kept = [k for k, v in enumerate(levels) if np.any(shown > v) and np.any(shown < v)]
    if kept:
        ax.contour(
            x, y, shown, levels=[levels[k] for k in kept], colors=INK,
            linewidths=[_WIDTHS[k] for k in kept], linestyles=[_DASHES[k] for k in kept],
        )  # fmt: skip
    ax.set_xlim(x[0], x[-1])
    ax.set_ylim(y[0], y[-1])


def _write_reasons(ax: Axes, panel: Panel) -> None:
    """Write each reason into the middle of its region, where there is room."""
    x, y = panel.x, panel.y
    written: list[tuple[float, float]] = []
    for reason in panel.reasons:
        region = ~(panel.values <= reason.level) & (x >= reason.from_x) & (x <= reason.to_x)
        place = _roomiest(region)
        if place is None:
            continue
        row, column, width = place
        across = (x[column] - x[0]) / (x[-1] - x[0])
        up = (y[row] - y[0]) / (y[-1] - y[0])
        if any(abs(up - other) < 0.2 and abs(across - side) < 0.4 for side, other in written):
            continue
        written.append((across, up))
        _write(ax, across, up, width, reason.words)


def _write(ax: Axes, across: float, up: float, width: float, words: str) -> None:
    """Write words around a place of the panel, in lines `width` of it wide, all inside it."""
    box = ax.get_window_extent()
    columns, rows = box.width / 72 / _LETTER_IN[0], box.height / 72 / _LETTER_IN[1]
    lines = textwrap.wrap(words, max(11, int(columns * width)))
    half_x = (max(map(len, lines)) + 2) / columns / 2
    half_y = (len(lines) + 1) / rows / 2
    ax.text(
        min(max(across, half_x), 1 - half_x), min(max(up, half_y), 1 - half_y), "\n".join(lines),
        transform=ax.transAxes, size=7, color=INK, ha="center", va="center", linespacing=1.05,
        bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none",
              "alpha": 0.85}, zorder=9,
    )  # fmt: skip


def _roomiest(region: BoolArray) -> tuple[int, int, float] | None:
    """Row, column and width (fraction of the panel) of the roomiest place in a region."""
    from scipy.ndimage import distance_transform_edt

    if not region.any():
        return None
    padded = np.pad(region, 1)
    rows, columns = region.shape
    depth = distance_transform_edt(padded, sampling=(1 / rows, 1 / columns))[1:-1, 1:-1]
    row, column = np.unravel_index(int(np.argmax(depth)), region.shape)
    if 2 * depth[row, column] < _LEAST_SIDE:
        return None
    width = np.count_nonzero(region[row]) / columns
    return int(row), int(column), min(max(float(width), 0.3), 0.62)


def _level_legend(figure: Figure, levels: Sequence[float], unit: str) -> None:
    """Draw the greys and lines of the levels above all panels."""
    from matplotlib.patches import Patch

    handles = [Patch(facecolor=_GREYS[0], edgecolor=INK, label=f"below {levels[0]:g}{unit}")]
    handles += [
        Patch(
            facecolor=grey, edgecolor=INK, linewidth=width, linestyle=dash,
            label=f"above {level:g}{unit}",
        )
        for level, grey, width, dash in zip(levels, _GREYS[1:], _WIDTHS, _DASHES, strict=True)
    ]  # fmt: skip
    figure.legend(
        handles=handles, loc="upper center", ncols=len(handles), frameon=False, fontsize=9,
        handlelength=2.6, borderaxespad=0.2,
    )  # fmt: skip


def columns_of(**arrays: FloatArray | list[str]) -> dict[str, list[float | str]]:
    """Return columns from arrays that broadcast together, and lists of texts of the same length.

    Names carry the units.
    """
    numbers = {name: a for name, a in arrays.items() if not isinstance(a, list)}
    spread = np.broadcast_arrays(*numbers.values())
    made: dict[str, list[float | str]] = {
        name: [float(v) for v in array.ravel()] for name, array in zip(numbers, spread, strict=True)
    }
    for name, words in arrays.items():
        if isinstance(words, list):
            made[name] = list(words)
    return made


def joined(parts: Sequence[Mapping[str, list[float | str]]]) -> dict[str, list[float | str]]:
    """Return the rows of several tables with the same columns, one after the other."""
    return {name: [value for part in parts for value in part[name]] for name in parts[0]}
