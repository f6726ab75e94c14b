"""How maps look: regions in greys with a contour at each level, and why in each region.

All is told by grey, line and word, so that it reads the same in black and white.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

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
class MapPicture:
    """A map: what it shows, what to read off it, the picture, and its numbers by column."""

    title: str
    caption: str
    svg: str
    columns: Mapping[str, list[float | str]]


@dataclass(frozen=True, slots=True)
class Reason:
    """Why it is so where values are above `level`, between two values of x."""

    words: str
    level: float
    from_x: float = -np.inf
    to_x: float = np.inf


def contours(
    ax: Axes,
    x: FloatArray,
    y: FloatArray,
    values: FloatArray,
    levels: Sequence[float] = PERCENT,
) -> None:
    """Regions of `values` (y, x) between levels, lighter where they are lower, and their edges."""
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


def say_why(
    ax: Axes, x: FloatArray, y: FloatArray, values: FloatArray, reasons: Sequence[Reason]
) -> None:
    """Write each reason into the middle of its region, where there is room."""
    written: list[tuple[float, float]] = []
    for reason in reasons:
        region = ~(values <= reason.level) & (x >= reason.from_x) & (x <= reason.to_x)
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
    """Words about a place of the panel, in lines that take `width` of it, and all inside it."""
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
    """Row, column and width (as a part of the panel) of the roomiest place in a region."""
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


def level_legend(figure: Figure, levels: Sequence[float] = PERCENT, unit: str = " %") -> None:
    """The greys and lines of the levels, above all panels."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Patch | Line2D] = [
        Patch(facecolor=_GREYS[0], edgecolor=INK, label=f"below {levels[0]:g}{unit}")
    ]
    for k, level in enumerate(levels):
        label = f"above {level:g}{unit}"
        handles.append(
            Patch(
                facecolor=_GREYS[k + 1],
                edgecolor=INK,
                linewidth=_WIDTHS[k],
                linestyle=_DASHES[k],
                label=label,
            )
        )
    figure.legend(
        handles=handles, loc="upper center", ncols=len(handles), frameon=False, fontsize=9,
        handlelength=2.6, borderaxespad=0.2,
    )  # fmt: skip


def columns_of(**arrays: FloatArray | list[str]) -> dict[str, list[float | str]]:
    """Columns from arrays that broadcast against each other, or lists of one length with them."""
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
    """The rows of several tables of the same columns, one after the other."""
    return {name: [value for part in parts for value in part[name]] for name in parts[0]}
